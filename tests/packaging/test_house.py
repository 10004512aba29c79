"""The rules of the house: who may import whom, what stays light and small."""

import ast
import re
import shutil
import subprocess
import sys
import sysconfig
from pathlib import Path

from tests.support.programs import PACKAGES, ROOT, run_bare
from tests.support.syntax import statements

HEAVY = ("torch", "stable_baselines3", "matplotlib", "pygame")


def sources(*patterns: str) -> list[Path]:
    """Return the repository's own files; builds, caches and environments have no part in it."""
    folders = ("flexarm_env", "baselines", "agents", "tests", "scripts", "docs")
    found = [path for pattern in patterns for path in ROOT.glob(pattern)]
    found += [path for folder in folders for pattern in patterns for path in (ROOT / folder).rglob(pattern)]
    return sorted(found)


def lint_imports(folder: Path, **environment: str) -> subprocess.CompletedProcess[str]:
    program = Path(sysconfig.get_path("scripts")) / "lint-imports"
    config = ROOT / "pyproject.toml"
    return run_bare(program, "--config", config, "--no-cache", "--no-logo", cwd=folder, **environment)


def test_imports_follow_the_flow() -> None:
    result = lint_imports(ROOT)
    assert result.returncode == 0, result.stdout + result.stderr


def test_agents_read_and_write_text_in_utf_8_on_every_machine() -> None:
    call = re.compile(r"\.(?:read_text|write_text)\(.*|\bopen\(.*\"[wa]\".*")
    for path in sorted((ROOT / "agents").rglob("*.py")):
        for line in call.findall(path.read_text(encoding="utf-8")):
            assert 'encoding="utf-8"' in line or "os.devnull" in line, f"{path}: {line}"


# A line that breaks a contract, the file it is added to, and what the report then says.
VIOLATIONS = (
    ("flexarm_env/parameters.py", "import flexarm_env.envs.single", "parameters -> flexarm_env.envs.single"),
    ("flexarm_env/codegen/tracing.py", "from flexarm_env.physics import dynamics", "tracing -> flexarm_env.physics"),
    ("flexarm_env/physics/dynamics.py", "import flexarm_env.kernels", "physics.dynamics -> flexarm_env.kernels"),
    ("flexarm_env/kernels/rk4.py", "import flexarm_env.episode.reward", "kernels.rk4 -> flexarm_env.episode.reward"),
    ("flexarm_env/simulation/arm.py", "import flexarm_env.episode.reset", "arm -> flexarm_env.episode.reset"),
    ("flexarm_env/simulation/limits.py", "import flexarm_env.analysis", "simulation.limits -> flexarm_env.analysis"),
    ("flexarm_env/unplaced/__init__.py", "", "unplaced"),
    ("flexarm_env/envs/info.py", "def late(): import torch", "flexarm_env.envs.info -> torch"),
    ("flexarm_env/envs/single.py", "import control", "flexarm_env.envs.single -> control"),
    ("flexarm_env/analysis/sensor.py", "import flexarm_env.analysis.zeros", "allowed in flexarm_env.analysis."),
    ("flexarm_env/analysis/margins.py", "import flexarm_env.rollout", "analysis.margins -> flexarm_env.rollout"),
    ("flexarm_env/envs/vector.py", "import flexarm_baselines", "flexarm_env.envs.vector -> flexarm_baselines"),
    ("flexarm_env/envs/batch.py", "import flexarm_agents", "flexarm_env.envs.batch -> flexarm_agents"),
    ("flexarm_baselines/paper_law/ifdc.py", "import flexarm_agents", "paper_law.ifdc -> flexarm_agents"),
    ("flexarm_agents/evaluation/scoring.py", "import flexarm_agents.training", "scoring -> flexarm_agents.training"),
    ("flexarm_agents/policies/load.py", "import torch", "flexarm_agents.policies.load -> torch"),
    ("flexarm_baselines/paper_law/flsac.py", "import flexarm_env", "paper_law.flsac -> flexarm_env"),
    ("scripts/paper/tables.py", "import scripts.analysis.tables", "scripts.paper.tables -> scripts.analysis"),
    ("scripts/common/markdown.py", "import scripts.paper", "scripts.common.markdown -> scripts.paper"),
)


def test_the_contracts_bite(tmp_path: Path) -> None:
    """One copy with every violation: the report names each."""
    for name, folder in (PACKAGES | {"scripts": ROOT / "scripts"}).items():
        shutil.copytree(folder, tmp_path / name, ignore=shutil.ignore_patterns("__pycache__"))
    for file, line, _ in VIOLATIONS:
        (tmp_path / file).parent.mkdir(exist_ok=True)
        with (tmp_path / file).open("a") as stream:
            stream.write(f"\n{line}\n")
    result = lint_imports(tmp_path, PYTHONPATH=str(tmp_path))
    assert result.returncode == 1, result.stdout + result.stderr
    report = result.stdout.partition("Broken contracts")[2]
    assert [text for _, _, text in VIOLATIONS if text not in report] == [], report


def test_nothing_imports_a_folder_by_its_generic_name() -> None:
    folder = "agents|baselines"  # other distributions own these names; ours import as flexarm_*
    called = rf"(?:import|spec|module)\w*\([\"'](?:{folder})\b"
    forbidden = re.compile(rf"^\W*(?:from|import) +(?:{folder})\b|python3? +-m +(?:{folder})\b|{called}", re.MULTILINE)
    for text in (">>> from baselines import policy", "import_module('agents.sb3')"):
        assert forbidden.search(text)
    files = [path for path in sources("*.md", "*.py", "*.pyi") if path != Path(__file__).resolve()]
    assert [str(path) for path in files if forbidden.search(path.read_text(encoding="utf-8"))] == []


def test_trained_policies_and_light_verbs_need_no_learning_library(tmp_path: Path) -> None:
    code = (
        "import sys; from flexarm_agents import evaluate, load_policy, shipped_policies, PPOConfig; "
        "PPOConfig(); from flexarm_agents.commands import evaluate, main, warm_up; "
        "main(['list']); main(['show', 'Square-v0']); "
        f"print(sorted(set({HEAVY!r}) & set(sys.modules)))"
    )
    result = run_bare(sys.executable, "-W", "error", "-c", code, cwd=tmp_path)
    assert result.returncode == 0, result.stderr
    assert result.stdout.splitlines()[-1] == "[]"


def test_compiled_code_is_kept_in_one_way() -> None:
    """`flexarm_env.codegen.cache` looks after its folder, damage and edits; numba's own cache would not."""
    cached = re.compile(r"^@\w*jit\w*\(.*cache=True", re.MULTILINE)
    packages = [path for path in sources("*.py") if path.relative_to(ROOT).parts[0] != "tests"]
    assert [str(path) for path in packages if cached.search(path.read_text(encoding="utf-8"))] == []


MOST_LINES, MOST_LINES_OF_A_FUNCTION = 350, 60


def test_files_stay_small() -> None:
    lengths = {
        str(path.relative_to(ROOT)): len(path.read_text(encoding="utf-8").splitlines()) for path in sources("*.py")
    }
    assert {name: length for name, length in lengths.items() if length > MOST_LINES} == {}


def length(function: ast.FunctionDef) -> int:
    """Count the lines of a function without its docstring."""
    first = function.body[0]
    documented = ast.get_docstring(function, clean=False) is not None
    described = (first.end_lineno or 0) - first.lineno + 1 if documented else 0
    return (function.end_lineno or 0) - function.lineno + 1 - described


def test_functions_stay_small() -> None:
    functions = {
        f"{path.relative_to(ROOT)}: {node.name}": length(node)
        for path in sources("*.py")
        for node in statements(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.FunctionDef)
    }
    assert {name: lines for name, lines in functions.items() if lines > MOST_LINES_OF_A_FUNCTION} == {}

"""What a wheel and a source archive hold, and that the wheel works outside the repository."""

import shutil
import sys
import tarfile
import zipfile
from pathlib import Path

import pytest

from tests.support.programs import PACKAGES, ROOT, run_bare

pytestmark = pytest.mark.slow
ARCHIVED = (".ci", ".github", "agents", "baselines", "docs", "flexarm_env", "scripts", "tests")


@pytest.fixture(scope="module")
def source(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Copy the repository, so that neither an old build folder nor this one can stain the other."""
    copy = tmp_path_factory.mktemp("source") / "flexarm"
    made = ("build", "dist", "results", "runs", "shared", "*.egg-info", "__pycache__")
    hidden = (".git", ".venv", ".hypothesis", ".*_cache")
    shutil.copytree(ROOT, copy, ignore=shutil.ignore_patterns(*made, *hidden))
    return copy


@pytest.fixture(scope="module")
def wheel(source: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    output = tmp_path_factory.mktemp("wheel")
    command = ["wheel", "--no-deps", "--no-build-isolation", "--wheel-dir", output, source]
    result = run_bare(sys.executable, "-m", "pip", *command, cwd=output)
    assert result.returncode == 0, result.stderr
    (built,) = output.glob("*.whl")
    return built


@pytest.fixture(scope="module")
def installed(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Install the wheel into a folder; what it needs comes from this environment."""
    site = tmp_path_factory.mktemp("installed") / "site"
    command = ["install", "--no-deps", "--target", site, wheel]
    result = run_bare(sys.executable, "-m", "pip", *command, cwd=wheel.parent)
    assert result.returncode == 0, result.stderr
    return site


def test_a_wheel_holds_the_packages_with_their_data_and_nothing_else(wheel: Path) -> None:
    """Every file of a package that is no source is data, and has to be declared as such."""
    files = set(zipfile.ZipFile(wheel).namelist())
    tops = {name.partition("/")[0] for name in files}
    assert {top for top in tops if not top.endswith(".dist-info")} == set(PACKAGES)
    for package, folder in PACKAGES.items():
        wanted = [path.relative_to(folder) for path in folder.rglob("*") if path.is_file() and path.suffix != ".pyc"]
        assert {f"{package}/{path.as_posix()}" for path in wanted} | {f"{package}/py.typed"} <= files


def test_a_source_archive_is_the_repository(source: Path, tmp_path: Path) -> None:
    code = f"from setuptools import build_meta; print(build_meta.build_sdist({str(tmp_path)!r}))"
    result = run_bare(sys.executable, "-c", code, cwd=source)
    assert result.returncode == 0, result.stderr
    (archive,) = tmp_path.glob("*.tar.gz")
    with tarfile.open(archive) as file:
        held = {name.partition("/")[2] for name in file.getnames()}
    wanted = {path for folder in ARCHIVED for path in (ROOT / folder).rglob("*")}
    wanted |= {path for path in ROOT.iterdir() if path.suffix in (".md", ".toml", ".txt", ".cff", ".json")}
    names = {path.relative_to(ROOT).as_posix() for path in wanted if path.is_file() and "__pycache__" not in path.parts}
    assert names <= held


def test_a_plain_install_imports_by_all_names(installed: Path, tmp_path: Path) -> None:
    code = (
        "import importlib.metadata, flexarm_agents, flexarm_baselines, flexarm_env; "
        "print(flexarm_env.__file__, flexarm_baselines.__file__, flexarm_agents.__file__, flexarm_env.__version__, "
        "importlib.metadata.version('flexarm'), sep='\\n')"
    )
    result = run_bare(sys.executable, "-c", code, cwd=tmp_path, PYTHONPATH=str(installed))
    assert result.returncode == 0, result.stderr
    *origins, version, declared = result.stdout.split()
    assert all(Path(origin).is_relative_to(installed) for origin in origins)
    assert version == declared


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("list",), ("FlexArm/Square-v0", "square", "plan_lqr")),
        (("show", "Square-v0"), ("FlexArm/Square-v0: ", "ACTION SPACE", "OPTIONS")),
        (("evaluate", "--policy", "square"), ("square: swing lap: ",)),
        (("evaluate", "--policy", "plan_lqr"), ("plan_lqr: swing lap: ",)),
        (("render", "joint_pd", "--lap", "plain", "--output", "lap.png"), ("plain lap, complete", "lap.png: written")),
        (("leaderboard", "--entries", "joint_pd", "--columns", "nominal", "--jobs", "1"), ("1 of 1 entries",)),
    ],
    ids=lambda value: " ".join(value),
)
def test_the_command_works_outside_the_repository(
    installed: Path, tmp_path: Path, arguments: tuple[str, ...], words: tuple[str, ...]
) -> None:
    """With the policies and plans of the wheel."""
    result = run_bare(installed / "bin" / "flexarm", *arguments, cwd=tmp_path, PYTHONPATH=str(installed))
    assert result.returncode == 0, result.stderr
    for word in words:
        assert word in result.stdout + result.stderr


USER = """
from flexarm_agents import load_policy
from flexarm_env import ArmParameters, EnvOptions, FlexibleArm, Trajectori, Trajectory
from flexarm_env.envs.vector import FlexArmVectorEnv

FlexArmVectorEnv(2, **EnvOptions(arm="linear", torque_limit=[100.0, 40.0]))
FlexArmVectorEnv(2, dealy=0.02)
run: Trajectory = FlexibleArm(ArmParameters.linear()).simulate([0.0] * 12, None, 0.1)
reveal_type(run.tip)
reveal_type(load_policy("square").environment)
wrong: str = FlexibleArm(ArmParameters.linear()).size
"""


def test_type_checkers_see_the_types_of_a_wheel(installed: Path, tmp_path: Path) -> None:
    (tmp_path / "user.py").write_text(USER)
    command = ["-m", "mypy", "--follow-imports=silent", "--ignore-missing-imports", "user.py"]
    result = run_bare(sys.executable, *command, cwd=tmp_path, MYPYPATH=str(installed))
    said = result.stdout
    assert said.count("error:") == 3, said
    assert 'has no attribute "Trajectori"' in said
    assert 'Unexpected keyword argument "dealy" for "FlexArmVectorEnv"' in said
    assert 'expression has type "int", variable has type "str"' in said
    assert "numpy.ndarray" in said or "ndarray[" in said
    assert 'Revealed type is "str"' in said or "builtins.str" in said

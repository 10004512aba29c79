"""The recipes run as they stand on their pages; one of a library that is not installed is skipped, naming it."""

import importlib.util
import re
import shlex
import sys
from pathlib import Path

import pytest

from tests.support.programs import ROOT, run_bare

FOLDER = ROOT / "docs" / "recipes"
FENCE = re.compile(r"^```(python|console)\n(.*?)^```", re.DOTALL | re.MULTILINE)
LIBRARIES = {
    "casadi": ("casadi",),
    "cleanrl": ("torch", "tyro"),
    "export": ("control", "onnx", "onnxruntime"),
    "minari": ("minari", "h5py"),
    "off_policy": ("stable_baselines3", "sb3_contrib", "yaml"),
    "rl_zoo3": ("rl_zoo3", "optuna", "requests", "pandas"),
    "rllib": ("ray.rllib",),
    "sbx": ("sbx",),
    "tianshou": ("tianshou",),
    "torchrl": ("torchrl",),
}
WITHOUT_SNIPPETS = ("README", "wrappers")


def fences(page: str) -> list[tuple[str, str]]:
    """Return the language, python or console, and the text of each snippet."""
    return FENCE.findall((FOLDER / f"{page}.md").read_text(encoding="utf-8"))


def is_installed(module: str) -> bool:
    """Return whether a module is there, without importing it: rl_zoo3 changes Gymnasium when it is imported."""
    try:
        return importlib.util.find_spec(module) is not None
    except ModuleNotFoundError:
        return False


def commands(language: str, text: str) -> list[list[str]]:
    """Return what a snippet runs; what it installs is there, or the test is skipped."""
    if language == "python":
        return [[sys.executable, "-c", text]]
    lines = text.replace("\\\n", " ").splitlines()
    found = [shlex.split(line, comments=True) for line in lines if line and not line.startswith("pip ")]
    programs = {"python": [], "flexarm": ["-c", "from flexarm_agents.commands import main; main()"]}
    return [[sys.executable, *programs[words[0]], *words[1:]] for words in found if words and words[0] in programs]


def test_every_recipe_is_tried() -> None:
    assert {path.stem for path in FOLDER.glob("*.md")} == {*LIBRARIES, *WITHOUT_SNIPPETS}
    for page in LIBRARIES:
        assert fences(page)
        for language, text in fences(page):
            lines = text.replace("\\\n", " ").splitlines()
            assert language == "python" or all(re.match(r"(pip|python|flexarm) ", line) for line in lines), page


def run(command: list[str], folder: Path) -> None:
    done = run_bare(*command, cwd=folder, PYTHONPATH=str(ROOT), MINARI_DATASETS_PATH=str(folder / "datasets"))
    assert done.returncode == 0, f"{command}\n{done.stdout[-3000:]}\n{done.stderr[-3000:]}"


@pytest.mark.slow
@pytest.mark.parametrize("page", LIBRARIES)
def test_recipes_of_libraries_run(page: str, tmp_path: Path) -> None:
    missing = [name for name in LIBRARIES[page] if not is_installed(name)]
    if missing:
        pytest.skip(f"needs {', '.join(missing)}, see docs/recipes/{page}.md")
    for name in ("agents", "docs"):
        (tmp_path / name).symlink_to(ROOT / name)  # the pages' commands are those of a clone
    for fence in fences(page):
        for command in commands(*fence):
            run(command, tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("algorithm", ["sac", "tqc", "ppo_lstm"])
def test_the_zoo_reads_the_settings(algorithm: str, tmp_path: Path) -> None:
    if not is_installed("rl_zoo3"):
        pytest.skip("needs rl_zoo3, see docs/recipes/rl_zoo3.md")
    file = ROOT / "agents" / "hyperparams" / f"{'recurrent_ppo' if algorithm == 'ppo_lstm' else algorithm}.yml"
    command = [sys.executable, "-m", "rl_zoo3.train", "--algo", algorithm, "--env", "FlexArm/Square-v0"]
    command += ["--gym-packages", "flexarm_env", "--conf-file", str(file), "--device", "cpu", "--eval-freq", "-1"]
    run([*command, "-n", "64", "--hyperparams", "n_envs:2"], tmp_path)
    assert list(tmp_path.glob(f"logs/{algorithm}/*/FlexArm-Square-v0.zip"))

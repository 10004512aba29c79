"""What Python says: of values that it refuses, of public objects, of missing extras and of old names."""

import json
import sys
from collections.abc import Callable
from importlib import import_module, metadata
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest

import flexarm_env
from flexarm_agents import config_of, load_policy, shipped_policies
from flexarm_agents.environments import check_id, check_options
from flexarm_agents.evaluation.candidates import imported
from flexarm_agents.policies.constant import ConstantPolicy
from flexarm_agents.policies.lstm import Lstm
from flexarm_agents.policies.network import NetworkPolicy
from flexarm_baselines.optimal.plan import load_plan
from flexarm_baselines.paper_law.ifdc import IFDC
from flexarm_baselines.registry import make_controller
from flexarm_env import ArmParameters, FlexibleArm, Trajectory, end_reason, run_policy, warm_up
from flexarm_env.envs.per_env import settings_of_each
from flexarm_env.envs.settings import Settings
from flexarm_env.envs.single import FlexArmEnv
from flexarm_env.envs.vector import FlexArmVectorEnv
from flexarm_env.extras import install_command
from flexarm_env.metrics import overshoot, tracking_error
from flexarm_env.predictor import predictor
from flexarm_env.renamed import _RenamedModules

LONGEST = 1500  # characters of a message: what is allowed takes some, too
STILL = FlexibleArm(ArmParameters.linear()).simulate(np.zeros(12), None, duration=0.01)


class Unshowable:
    def __repr__(self) -> str:
        raise RuntimeError("no repr")


REFUSALS: dict[str, Callable[[Any], Any]] = {
    "an option": lambda value: FlexArmEnv(frame=value),
    "reset's options": lambda value: FlexArmEnv(arm="linear").reset(options=value),
    "an option of reset": lambda value: FlexArmEnv(arm="linear").reset(options={"start": value}),
    "parameters of an episode": lambda value: FlexArmEnv(arm="linear").reset(options={"parameters": value}),
    "a batch's reset": lambda value: FlexArmVectorEnv(2, arm="linear").reset(options=value),
    "a mask": lambda value: FlexArmVectorEnv(2, arm="linear").reset(options={"reset_mask": value}),
    "autoreset_mode": lambda value: FlexArmVectorEnv(2, autoreset_mode=value),
    "warm_up": lambda value: warm_up(["FlexArm/Square-v0"], value),
    "end_reason": end_reason,
    "an environment to run": lambda value: run_policy(value, None),
    "a policy": lambda value: predictor(value, True),
    "a tip": lambda value: tracking_error(STILL, tip=value),
    "an id": check_id,
    "options in a file": lambda value: check_options("FlexArm/Square-v0", value),
    "plain options": lambda value: check_options("FlexArm/Square-v0", {"frame": value}),
    "hidden layers": lambda value: config_of(hidden=value),
}


@pytest.mark.parametrize("value", ["x" * 100_000, Unshowable()], ids=["long", "unshowable"])
@pytest.mark.parametrize("refuse", REFUSALS.values(), ids=REFUSALS)
def test_any_value_is_shown_in_a_line(refuse: Callable[[Any], Any], value: Any) -> None:
    with pytest.raises((TypeError, ValueError)) as caught:
        refuse(value)
    assert len(str(caught.value)) < LONGEST


@pytest.mark.parametrize("refuse", [load_policy, imported, Trajectory.load])
def test_a_long_name_is_cut(refuse: Callable[[str], Any]) -> None:
    with pytest.raises((OSError, ValueError)) as caught:
        refuse("x" * 100_000)
    assert len(str(caught.value)) < LONGEST


def test_a_direction_that_is_none() -> None:
    with pytest.raises(ValueError, match=r"incoming = array\(\[0\., 0\.\]\): must be a direction"):
        overshoot(STILL.tip, STILL.time, np.zeros(2), np.zeros(2), (0.0, 1.0))


# --- of public objects -----------------------------------------------------------------------------------------------


SQUARE = "flexarm_env:FlexArm/Square-v0"
LONGEST_LINE = 240
LAYERS = ([np.zeros((2, 3), np.float32)], [np.zeros(2, np.float32)], np.zeros(2, np.float32))


def controller(name: str) -> Any:
    from flexarm_baselines.registry import controller

    return make_controller(name, FlexArmEnv(**controller(name).options))


def run() -> Any:
    return FlexibleArm(ArmParameters(modes_per_link=1)).record(np.zeros(1), np.zeros((1, 8)), np.zeros((1, 2)))


@pytest.mark.parametrize(
    ("made", "words"),
    [
        (lambda: FlexArmEnv(noise=0.1), ("FlexArmEnv", "torque", "'default'", "10 ms", "46 ")),
        (lambda: gymnasium.make(SQUARE), ("TimeLimit<", "<FlexArmEnv FlexArm/Square-v0: torque", "10 ms", "46 ")),
        (lambda: FlexArmVectorEnv(3, arm="linear"), ("num_envs=3", "'linear'")),
        (lambda: FlexArmVectorEnv(2, per_env={"noise": [0.0, 0.1]}), ("num_envs=2", "per_env")),
        (lambda: NetworkPolicy(*LAYERS), ("NetworkPolicy(3 -> 2, elu)",)),
        (lambda: ConstantPolicy(2, 0.5), ("ConstantPolicy", "0.5")),
        (lambda: Lstm(np.zeros((8, 3), np.float32), np.zeros((8, 2), np.float32), np.zeros(8, np.float32)), ("Lstm",)),
        (lambda: controller("joint_pd"), ("JointTracking", "joint_rates")),
        (lambda: controller("joint_pd").task, ("Task", "period=0.01", "16 s")),
        (lambda: controller("flsac"), ("FLSAC", "K_n=5.0")),
        (lambda: FlexibleArm(), ("FlexibleArm", "4.5", "foreshortened")),
        (lambda: load_plan("default_swing"), ("Plan", "1600")),
        (run, ("Trajectory", "1 instants")),
        *((lambda name=name: load_policy(name), (name, "-> ", "FlexArm/")) for name in shipped_policies()),
    ],
)
def test_a_line_says_what_it_is(made: Any, words: tuple[str, ...]) -> None:
    it = made()
    for text in (repr(it), str(it)):
        assert len(text) <= LONGEST_LINE
        assert "\n" not in text
        assert " object at " not in text
        for word in words:
            assert word in text


# --- of a missing extra ----------------------------------------------------------------------------------------------


WHEEL, REPOSITORY = "file:///tmp/flexarm-1.0-py3-none-any.whl", "https://example.org/flexarm"


def test_in_a_clone_its_folder_is_named(tmp_path: Path) -> None:
    (tmp_path / "pyproject.toml").touch()
    assert install_command("train", tmp_path / "flexarm_env") == f'pip install -e "{tmp_path}[train]"'


@pytest.mark.parametrize(
    ("source", "requirement"),
    [
        (None, "flexarm[train]"),
        ({"url": WHEEL, "archive_info": {}}, f"flexarm[train] @ {WHEEL}"),
        ({"url": REPOSITORY, "vcs_info": {"vcs": "git", "commit_id": "abc"}}, f"flexarm[train] @ git+{REPOSITORY}@abc"),
    ],
)
def test_elsewhere_its_source_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, source: dict[str, Any] | None, requirement: str
) -> None:
    class Installed:
        def read_text(self, name: str) -> str | None:
            return None if source is None else json.dumps(source)

    monkeypatch.setattr(metadata, "distribution", lambda name: Installed())
    assert install_command("train", tmp_path / "flexarm_env") == f'pip install "{requirement}"'


def test_beside_no_installation_the_extra_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def absent(name: str) -> Any:
        raise metadata.PackageNotFoundError(name)

    monkeypatch.setattr(metadata, "distribution", absent)
    assert install_command("train", tmp_path / "flexarm_env") == 'pip install "flexarm[train]"'


# --- of old names ----------------------------------------------------------------------------------------------------


RENAMED = [names for finder in sys.meta_path if isinstance(finder, _RenamedModules) for names in finder._names.items()]


@pytest.mark.parametrize(("old", "new"), RENAMED)
def test_an_old_name_imports_with_a_warning(old: str, new: str) -> None:
    sys.modules.pop(old, None)
    with pytest.warns(DeprecationWarning, match=f"^{old} is now {new};"):
        module = import_module(old)
    public = [name for name in vars(import_module(new)) if not name.startswith("__")]
    assert public
    assert all(getattr(module, name) is getattr(import_module(new), name) for name in public)


def test_the_warning_is_at_the_line_that_imports() -> None:
    sys.modules.pop("flexarm_baselines.ifdc", None)
    with pytest.warns(DeprecationWarning, match="paper_law") as found:
        from flexarm_baselines.ifdc import IFDC as OLD
    assert OLD is IFDC
    assert found[0].filename == __file__


@pytest.mark.parametrize("name", ["ClosedLoop", "LoopCase", "square_loop"])
def test_a_removed_name_says_what_is_there_in_its_place(name: str) -> None:
    with pytest.raises(ImportError, match=rf"flexarm_env\.{name} is removed: .*make_vec"):
        getattr(flexarm_env, name)
    with pytest.raises(AttributeError, match="no attribute 'Closedloop'"):
        flexarm_env.Closedloop  # noqa: B018


def test_old_names_of_options_warn() -> None:
    with pytest.warns(DeprecationWarning, match="hold is now sensor_period"):
        assert Settings.of({"hold": 0.02}).sensor_period == 0.02
    with pytest.raises(ValueError, match=r"hold = 0\.1 beside sensor_period: give sensor_period alone"):
        Settings.of({"hold": 0.1, "sensor_period": 0.2})
    with pytest.warns(DeprecationWarning, match="law_sensor is now feedback_source"):
        env = gymnasium.make("FlexArm/Paper-v0", law_sensor="joints").unwrapped
    assert env.settings.feedback_source == "joints"  # type: ignore[attr-defined]
    with pytest.warns(DeprecationWarning, match="inner_resistance is now inner_damping"):
        assert settings_of_each({"action_mode": "residual"}, {"inner_resistance": [(40.0, 30.0)] * 2}, 2, "batch")

"""Configurations of a training: what they refuse, how they survive a file, and the tuned ones in rl-zoo3's format."""

import importlib
import inspect
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import torch
import yaml

import flexarm_agents
from flexarm_agents import DAggerConfig, PPOConfig, SACConfig, config_of, load_policy, shipped_policies, train
from flexarm_agents.environments import check_id, make_one
from flexarm_agents.training.config import read_config
from flexarm_agents.training.hyperparameters import settings_of
from flexarm_agents.training.models import arguments
from flexarm_agents.training.run_folder import RunFolder
from tests.support.trainings import DESCENDED, ID, TINIES, TINY

DAGGER, FOPG = {"algorithm": "dagger"}, {"algorithm": "fopg"}
ALTERNATE = {**DAGGER, "drawn_paths": 2}
SMALL = DESCENDED  # what a training alone refuses
INITIAL, OBSERVED, LATER = TINIES["initial"], TINIES["observer"], TINIES["curriculum"]
WIDER = TINIES["widening"]
RESIDUAL = {"environment": "SquareResidual-v0"}
WEAK = {"torque_limit": [100.0, 50.0]}
DRAWN = {"randomisation": {"payload_mass": [0.0, 1.0]}}
SECOND = {"second_sensor_link": 1, "observation": ["joint_error", "second_sensed_position"]}


REFUSED: dict[type[Exception], list[tuple[dict[str, Any], str]]] = {
    TypeError: [
        ({"options": {"noize": 1.0}}, r"keyword argument 'noize'; did you mean 'noise'"),
        ({"options": {"arm": object()}}, r"options = .*: must be plain values \(JSON\)"),
        ({"envs": 1.5}, r"envs = 1.5: must be an integer >= 1"),
        ({"hidden": ()}, r"hidden = \(\): must be a list of sizes"),
        ({"algorithm": "sac", "clip": 0.2}, r"SACConfig.* keyword argument 'clip'"),
        ({"initial_policy": ""}, r"initial_policy = '': must be a folder, a file or a name"),
        ({"curriculum_options": {"noize": 1.0}}, r"keyword argument 'noize'; did you mean 'noise'"),
        ({"curriculum_options": [1]}, r"curriculum_options = \[1\]: must be a mapping"),
        ({**DAGGER, "plans": ""}, r"plans = '': must be the path of a folder"),
        ({**DAGGER, "lags": 3}, r"lags = 3: must be a list or a tuple"),
    ],
    FileNotFoundError: [({**INITIAL, "initial_policy": "nobody"}, r"'nobody': neither a folder or file nor a shipped")],
    ValueError: [
        ({"environment": "CartPole-v1"}, r"environment = 'CartPole-v1': must be one of 'FlexArm/Carry-v0'"),
        ({"options": {"noise": -1.0}}, r"noise = -1.0: must be"),
        ({"steps": 0}, r"steps = 0: must be an integer >= 1"),
        ({"batch": 1000}, r"batch = 1000: must divide rollout \* envs = 64 \* 64 = 4096"),
        ({"gamma": 1.5}, r"gamma = 1.5: must be .* <= 1.0"),
        ({"learning_rate": 0.0}, r"learning_rate = 0.0: must be .* > 0.0"),
        ({"learning_rate": 1e-6}, r"final_learning_rate = .*: must be <= learning_rate = 1e-06"),
        ({"seed": -1}, r"seed = -1: must be an integer from 0 to"),
        ({"hidden": (8, 0)}, r"hidden\[1\] = 0: must be an integer >= 1"),
        ({"algorithm": "dqn"}, r"algorithm = 'dqn': must be one of 'ppo', 'recurrent_ppo', 'sac', 'tqc'"),
        ({"algorithm": "sac", "buffer": 999}, r"buffer = 999: must be a multiple of envs = 32, and >="),
        ({"algorithm": "tqc", "quantiles": 2}, r"dropped_quantiles = 3: must be < quantiles = 2"),
        ({"algorithm": "recurrent_ppo", "lstm": 0}, r"lstm = 0: must be an integer >= 1"),
        ({"privileged_critic": True, "options": {"observation": ["state"]}}, r"policy must see neither of \('state'"),
        ({"lags": (2, 1)}, r"lags = \(2, 1\): must increase"),
        ({"lags": (1,), "observer": "delay"}, r"a policy has one of them at most"),
        ({"observer": "nominal"}, r"observation: must have 'joint_angles', 'sensed_position' with an obs"),
        ({**RESIDUAL, "observer": "delay"}, r"action_mode = 'residual': must be 'torque' with an observer"),
        ({"value_steps": 5}, r"value_steps = 5: must go with initial_policy, and be < steps = 2000000"),
        ({**INITIAL, "value_steps": 512}, r"value_steps = 512: must go with initial_policy, and be < steps"),
        ({"value_learning_rate": 0.0}, r"value_learning_rate = 0.0: must be .* > 0.0"),
        ({"curriculum_steps": 1, "curriculum_options": {}}, r"curriculum_steps = 1: must go with curriculum"),
        ({**WIDER, "curriculum_options": {"noise": 0.0}, "curriculum_steps": 200}, "curriculum_steps = 200: must be"),
        ({**WIDER, "options": {}}, r"automatic_randomisation = True: randomisation = \{\} must have ranges"),
        ({**WIDER, "options": {"randomisation": {"lap_time": [14, 16]}}}, "automatic_randomisation = True: .* only"),
        ({**LATER, "curriculum_steps": 512}, r"curriculum_steps = 512: must .*, and be < steps = 512"),
        ({**LATER, "curriculum_steps": 0}, r"curriculum_steps = 0: must be an integer >= 1"),
        ({**TINY, "curriculum_options": {"last_actions": 2}}, r"curriculum_options = .*: must leave observ"),
        ({**DAGGER, "curriculum_options": {"start": "corners"}}, r"curriculum_options\['start'\] = 'corners': must be"),
        ({**DAGGER, "drawn_paths": 2, "plants": [2, 2]}, r"plants = \(2, 2\): must be left out with drawn_paths"),
        ({**TINY, "curriculum_options": WEAK}, r"curriculum_options = .*: must leave observation and act"),
        ({**OBSERVED, "initial_policy": "square"}, r"'square', observer = 'nominal': the network behind an"),
        ({**INITIAL, "hidden": [64, 64]}, r"'student_gauges': its hidden must be \(64, 64\), got \(128"),
        ({**INITIAL, "activation": "tanh"}, r"'student_gauges': its activation must be 'tanh', got 'elu'"),
        ({**INITIAL, "lags": [1]}, r"'student_gauges': its lags must be \(1,\), got \(\)"),
        ({**INITIAL, "initial_policy": "student"}, r"'student': was trained on .* another observation or"),
        ({**INITIAL, "options": {"frame": "world"}}, r"'student_gauges': was trained on .* another observ"),
        ({"activation": "selu"}, r"activation = 'selu': must be one of 'elu', 'tanh', 'relu'"),
        ({**DAGGER, "arms": 3}, r"arms = 3: must be even, half of them for each lap"),
        ({**DAGGER, "averaging": 1.5}, r"averaging = 1.5"),
        ({**DAGGER, "options": {"side": 10.0}}, r"side = 10.0: the teacher has plans for 12.6 only"),
        ({**DAGGER, "curriculum_options": {"lap_time": 20.0}}, r"lap_time = 20.0: the teacher has plans for 16.0"),
        ({**DAGGER, "curriculum_options": {"last_actions": 2}}, r"curriculum_options = .*: must leave observ"),
        ({**DAGGER, "options": {"randomisation": {"side": [12, 12.6]}}}, r"randomisation\['side'\] = .*: must be left"),
        ({**DAGGER, "drawn_paths": 2, "options": {"control_period": 0.02}}, r"control_period = 0.02: the teacher has"),
        ({**DAGGER, "alternate_options": {"noise": 0.1}}, r"drawn_paths = 0: must be >= 2 with alternate_options"),
        ({**ALTERNATE, "alternate_options": {"start": "corner"}}, r"alternate_options\['start'\] = 'corner': must be"),
        ({**ALTERNATE, "alternate_options": {"last_actions": 2}}, r"alternate_options = .*: must leave observ"),
        ({**ALTERNATE, "alternate_options": {"control_period": 0.02}}, r"control_period = 0.02: the teacher has"),
        ({**DAGGER, "plants": [1, 3]}, r"plants\[0\] = 1"),
        ({**FOPG, "horizon": 1}, r"horizon = 1: must be an integer >= 2"),
        ({**FOPG, "error_knee": 0.0}, r"error_knee = 0.0"),
        ({**FOPG, "critic_observation": ["sight"]}, r"critic_observation\[0\] = 'sight'"),
        ({**FOPG, "critic_observation": ["state", "state"]}, r"each only once"),
        ({**FOPG, "critic_epochs": 0, "critic_batch": 64}, r"critic_batch = 64: has no effect with critic"),
        ({**SMALL, "options": {"action_mode": "torque_rate"}}, r"action_mode = .*: derivatives run through"),
        ({**FOPG, "options": {"sensor": "rigid"}}, r"sensor = 'rigid': derivatives run through 'true' only"),
        ({**SMALL, "options": {"noise": 0.01}}, r"noise = 0.01: derivatives run through 0.0 only"),
        ({**FOPG, "options": {"encoder_noise": [0.0, 0.01]}}, r"encoder_noise = .*: derivatives run through"),
        ({**FOPG, "options": {"actuation_delay": 0.01}}, r"actuation_delay = 0.01: derivatives run through"),
        ({**FOPG, "options": {"pulse_force": [1.0, 0.0]}}, r"pulse_force = .*: derivatives run through"),
        ({**SMALL, "options": DRAWN}, r"randomisation = .*: derivatives run through"),
        ({**SMALL, "options": SECOND}, r"second_sensor_link = 1: derivatives run through"),
        ({**SMALL, "curriculum_options": {"noise": 0.01}}, r"noise = 0.01: derivatives run through"),
        ({**SMALL, "curriculum_options": {"frame": "world"}}, r"curriculum_options = .*: must leave"),
        ({**FOPG, "torque_noise": 2.0}, r"torque_noise = 2.0"),
        ({**FOPG, "rounds": 4}, r"trial_rounds = 4: must be less than rounds = 4, with more than one of"),
    ],
}


@pytest.mark.parametrize(
    ("error", "options", "message"), [(error, *case) for error, cases in REFUSED.items() for case in cases]
)
def test_impossible_trainings(error: type[Exception], options: dict[str, Any], message: str, tmp_path: Path) -> None:
    with pytest.raises(error, match=message):
        train(config_of(**options), tmp_path / "run")
    assert not (tmp_path / "run").exists()


def test_a_configuration_survives_a_file() -> None:
    config = config_of(**{**TINY, "environment": "flexarm_env:FlexArm/Square-v0", "seed": 3})
    assert config == config_of(**{**TINY, "environment": "Square-v0", "seed": 3})
    assert config.environment == ID
    assert config.folder == Path("runs/Square-v0-ppo-3")
    again = read_config(json.loads(json.dumps(config.plain())))
    assert again == config
    assert config.differences(again) == []
    with pytest.raises(TypeError, match=r"keyword argument 'gama'; did you mean 'gamma'"):
        read_config({"gama": 0.9})


@pytest.mark.parametrize("name", shipped_policies())
def test_configurations_of_the_last_release_are_read(name: str) -> None:
    """Fields of other algorithms, and the former names of fields; the network has the sizes that they say."""
    values, policy = load_policy(name).notes["config"], load_policy(name).policy
    config = read_config(values) if "algorithm" in values else DAggerConfig.of(values)
    assert config.hidden == tuple(len(bias) for bias in policy.biases[:-1])
    assert config.curriculum_options == values.get("lesson_options", values.get("curriculum_options"))


def test_former_names_warn() -> None:
    with pytest.warns(DeprecationWarning, match=r"flexarm_agents.TrainingConfig is now flexarm_agents.config_of"):
        kind = flexarm_agents.TrainingConfig
    assert kind(algorithm="sac", lesson_options={}) == SACConfig(curriculum_options={})


@pytest.mark.parametrize("text", ["{", "[]", "{}", '{"format": 99}', '{"format": 1, "gama": 1}'])
def test_a_spoilt_configuration(tmp_path: Path, text: str) -> None:
    (tmp_path / "config.json").write_text(text)
    with pytest.raises(ValueError, match=r"config.json: not a training's configuration"):
        RunFolder(tmp_path).read_config(PPOConfig)


FOLDER = Path(flexarm_agents.__file__).parent / "hyperparams"
CLASSES = {
    "ppo": ("stable_baselines3", "PPO"),
    "sac": ("stable_baselines3", "SAC"),
    "tqc": ("sb3_contrib", "TQC"),
    "recurrent_ppo": ("sb3_contrib", "RecurrentPPO"),
}
ZOOS = {"n_timesteps", "n_envs", "env_kwargs"}


def settings(algorithm: str) -> dict[str, Any]:
    found: dict[str, Any] = yaml.safe_load((FOLDER / f"{algorithm}.yml").read_text(encoding="utf-8"))
    return found


def test_an_id_that_the_file_lacks_has_the_settings_of_the_first_id_and_no_curriculum() -> None:
    other = replace(config_of(), environment="FlexArm/Track-v0", curriculum_options={})
    assert other == config_of(environment="Track-v0")
    own = [config_of(algorithm="sac", environment=f"{name}-v0").steps for name in ("SquareResidual", "SquareEncoders")]
    assert own == [200_000, 500_000]


def test_a_curriculum_leaves_what_the_options_say() -> None:
    """Tuned starts hold unless the options speak of starts; a file from before there were curricula has none."""
    assert config_of().curriculum_options == {"start": "corners"}
    assert config_of(options={"noise": 0.001}).curriculum_options == {"start": "corners"}
    for options in ({"start": "moving"}, {"start_spread": [0.2, 0.2]}):
        assert config_of(options=options).curriculum_options == {}
    before = config_of().plain()
    del before["curriculum_options"]
    assert read_config(before) == config_of(curriculum_options={})


@pytest.mark.parametrize("algorithm", CLASSES)
def test_every_setting_reaches_the_model(algorithm: str) -> None:
    """What the model is made with is what the file says, by the names of the library; environments take the rest."""
    assert {path.stem for path in FOLDER.glob("*.yml")} == set(CLASSES)
    module, name = CLASSES[algorithm]
    known = inspect.signature(getattr(importlib.import_module(module), name)).parameters
    for environment, one in settings(algorithm).items():
        assert check_id(environment) == environment  # the zoo looks for the whole id
        make_one(environment, one["env_kwargs"]).close()
        assert set(one) - ZOOS <= set(known), environment
        assert "n_steps" not in one or one["n_envs"] * one["n_steps"] % one["batch_size"] == 0
        found = arguments(config_of(algorithm=algorithm, environment=environment))
        assert one["learning_rate"].startswith("lin_")
        assert found.pop("learning_rate")(1.0) == float(one["learning_rate"].removeprefix("lin_"))
        policy = eval(one["policy_kwargs"], {"nn": torch.nn})
        assert {**found, "policy_kwargs": dict(found["policy_kwargs"])} == {
            name: value for name, value in one.items() if name not in {*ZOOS, "policy", "learning_rate"}
        } | {"policy_kwargs": policy}


def test_settings_that_are_not_the_algorithms_are_refused() -> None:
    one = settings("ppo")["FlexArm/Square-v0"]
    with pytest.raises(ValueError, match=r"hyperparams/ppo.yml: has no use for tau"):
        settings_of(PPOConfig, one | {"tau": 0.1})
    with pytest.raises(ValueError, match=r"hyperparams/ppo.yml: lacks gamma"):
        settings_of(PPOConfig, {name: value for name, value in one.items() if name != "gamma"})
    with pytest.raises(ValueError, match=r"policy_kwargs = '__import__\(\"os\"\)': must be dict"):
        settings_of(PPOConfig, one | {"policy_kwargs": '__import__("os")'})

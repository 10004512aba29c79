"""Options: what is taken and what refused, with messages that name what is wrong in few words."""

import math
from dataclasses import fields
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

from flexarm_env.actions import MODES
from flexarm_env.allowed import allowed_of
from flexarm_env.envs.settings import Settings
from flexarm_env.envs.single import FlexArmEnv
from scripts.docs import environments
from tests.support.envs import GAIN, PAPER, RESIDUAL, SQUARE, WAYPOINTS, make
from tests.support.refusals import label, refuses, wrong_values

MISMATCHED = {"masses_per_length": (1e-9, 1e-9), "payload_inertia": 1e9}
ON_LINK_1 = {"observation": ["second_sensor_error"], "second_sensor_link": 1}


REFUSED: dict[tuple[str, type[Exception]], list[tuple[str, dict[str, Any]]]] = {
    (SQUARE, ValueError): [
        (r"arm = 'papers': must be one of 'default', 'linear', 'paper', 'quanser'", {"arm": "papers"}),
        (r"arm: unknown field\(s\) \['mass'\]; ArmParameters has .*'link_le", {"arm": {"mass": 1.0}}),
        (r"arm = 'new': must be one of 'default', 'linear', 'paper', 'quanser'", {"arm": {"preset": "new"}}),
        (r"payload_changes = .*: must have two masses at least", {"payload_changes": ((0.1, None), (0.2, 0.0))}),
        (r"physics_step = 0\.02 s: too long .* 323 rad/s; at most 0\.00619", {"physics_step": 0.02}),
        (r"sensor_position = 4\.6 m: must be on link 2, > 0 and <= 4\.5 m", {"sensor_position": 4.6}),
        (r"delay = -0\.001: must be .* >= 0\.0 and <= 10\.0 \[s\]", {"delay": -1e-3}),
        (r"delay = .* one number \[s\].*randomisation=.'delay': \(0\.1, 0\.2\)", {"delay": (0.1, 0.2)}),
        (r"sensor_position = 4\.0 m: .*; side = 12\.6 m: ", {"arm": {"link_lengths": (3, 3)}, "sensor_position": 4.0}),
        (r"delay = 0\.1: .* must be None", {"sensor": "collocated", "delay": 0.1}),
        (r"observation = 'tip': must be one of 'joint_angles', ", {"observation": ["tip"]}),
        (r"observation = \[\]: must hold at least one name, and each only once", {"observation": []}),
        (r"observation = .*: must hold .* each only once", {"observation": ["lap_phase"] * 2}),
        (r"previews\[1\] = 0\.0: must be .* >= 1e-06 .* \[s; in a race m\]", {"previews": (0.1, 0.0)}),
        (r"reference = 'heart': must be one of 'square', 'circle', .*'moves'", {"reference": "heart"}),
        (r"reference = 'moves': must be one of .*'waypoints'$", {"reference": ["square", "moves"]}),
        (r"waypoints = None: must be given with the reference 'waypoints'", {"reference": "waypoints"}),
        (r"waypoints = .*only with it; reference = \('square',\)", {"waypoints": WAYPOINTS}),
        (r"^waypoints: must be at least 2 points, got 1$", {"reference": "waypoints", "waypoints": [(1.0, 1.0)]}),
        (r"path: way-point .* misses it by 0\.05097 m", {"side": 12.8}),
        (r"\['stiffness'\]\[0\] = 0\.0: must be .* >= 0\.1", {"randomisation": {"stiffness": (0.0, 1.0)}}),
        (r"\['noise'\] = .*the first must not be above the sec", {"randomisation": {"noise": (0.2, 0.1)}}),
        (r"\['delay'\]: a collocated sensor", {"randomisation": {"delay": (0.0, 0.1)}, "sensor": "collocated"}),
        (r"reward_weights\['speed'\]: no such term; there are 'tracking_wide'", {"reward_weights": {"speed": 1.0}}),
        (r"reward_weights\['effort'\] = -1000.*: must be .* >= -1000", {"reward_weights": {"effort": -1e13}}),
        (r"reward_weights = .*: one at least must not be 0", {"reward_weights": {"effort": 0.0}}),
        (r"physics_step = 1e-09 s: 1e\+07 integration steps .*at most 20000 are", {"physics_step": 1e-9}),
        (r"arm = .*friction.*rad/s.* integration steps in con", {"arm": {"joint_friction": (1e6, 1e6)}}),
        (r"arm: its masses and inertias lie too far apart .*payload_inertia = 1000", {"arm": MISMATCHED}),
        (r"delay = 10\.0 s, .* readings to keep, .*at most 2000000", {"delay": 10.0, "physics_step": 1e-6}),
        ("actuation_delay = 0.005 s: must be a whole number", {"action_mode": "reference", "actuation_delay": 0.005}),
        ("previews = \\(0.1,\\): has no effect here", {"observation": ("joint_rates",), "previews": (0.1,)}),
        ("last_actions = 3: has no effect here", {"observation": ("joint_rates",), "last_actions": 3}),
        ("previews = ", {"previews": ()}),
        ("wave_speed = 100.0: has no effect here", {"delay": 0.01, "wave_speed": 100.0}),
        ("jitter = 0.01: has no effect here", {"sensor": "collocated", "jitter": 0.01}),
        ("start_spread = .*: has no effect here", {"start": "corner", "start_spread": (0.1, 0.1)}),
        ("side = 8.0: has no effect here", {"reference": "moves", "side": 8.0}),
        ("lap_time = 0.2 s: must be at least 40 control periods", {"reference": "moves", "lap_time": 0.2}),
        ("start = 'mix' with lap_time = 0.3 s", {"lap_time": 0.3}),
        (r"second_sensor_link = 1: has no effect here; .*'second_sensed_po", {"second_sensor_link": 1}),
        (r"second_sensor_position = 1\.0: has no .*second_sensor_link", {"second_sensor_position": 1.0}),
        (r"second_sensor_position = 4\.6 m: .*link 1, .*4\.5", ON_LINK_1 | {"second_sensor_position": 4.6}),
        (r"there is no second sensor; give second_sensor_link", {"observation": ["second_sensor_error"]}),
        (r"imu_link = 1: has no effect here; .*'accelerometer' or 'gyro'", {"imu_link": 1}),
        (r"imu_bias = .*: has no .* an IMU: imu_link = 1 or 2", {"imu_bias": (0.1, 0.1)}),
        (r"observation block 'gyro': there is no IMU; give imu_link", {"observation": ["gyro"]}),
        (r"sensor_period = 1e-06 s: more than 20000 .* ticks in jit", {"sensor_period": 1e-6, "jitter": 1.0}),
        (r"render_mode = 'ansi': must be one of 'rgb_array', 'human'", {"render_mode": "ansi"}),
    ],
    (SQUARE, TypeError): [
        (r"arm = 2: must be one of 'default', .* or a mapping of ArmParameters fields", {"arm": 2}),
        (r"delay = 'late': must be a .* \[s\]", {"delay": "late"}),
        (r"observation = 'lap_phase': must be a list or a tuple", {"observation": "lap_phase"}),
        (r"observation = \[1\]: must hold names", {"observation": [1]}),
        (r"previews = 0\.1: must be a list or a tuple", {"previews": 0.1}),
        (r"reference = <object .*'circle', .*waypoints=\[\(x, y\),", {"reference": object()}),
        (r"randomisation\['delay'\] = 0\.1: must be a pair of numbers", {"randomisation": {"delay": 0.1}}),
        (r"randomisation = \[1\]: must be a mapping of names", {"randomisation": [1]}),
        (r"reward_weights = 1\.0: must be a mapping of names", {"reward_weights": 1.0}),
        (r"reward = 1\.0: must be a function", {"reward": 1.0}),
        (r"termination = True: must be a function", {"termination": True}),
        (r"torque_limit = <memory at .*: must be a pair of numbers", {"torque_limit": memoryview(b"ab")}),
        (r"FlexArmEnv\.__init__\(\) got an unexpected keyword argument 'wind'; see help\(FlexArmEnv\)", {"wind": 3.0}),
    ],
    (PAPER, ValueError): [
        (r"physics_step = 0\.1 s: too long .* at most 0\.01218 s is allowed", {"physics_step": 0.1}),
        (r"compensation = 'shared': .* must be 'none'", {"sensor": "collocated", "compensation": "shared"}),
        (r"jitter = 0\.01: .* must be 0 with feedback_source = 'sensor'", {"jitter": 0.01}),
        (r"sensor_period = 0\.02: .* must be 0 with feedback_source = 'sensor'", {"sensor_period": 0.02}),
        (r"dropout = 0\.5: .* must be 0 with feedback_source = 'sensor'", {"dropout": 0.5}),
        (r"delay\[1\] = inf: must be .* \[s\]", {"delay": (0.01, math.inf)}),
    ],
    (GAIN, ValueError): [
        (r"compensation = 'shared': has no effect here; only with feedback_source", {"compensation": "shared"}),
        (r"delayed = 'position\+rate': has no effect here; only with feedback_source", {"delayed": "position+rate"}),
        (r"rate_jacobian = 'current': has no effect here; only with feedback_source", {"rate_jacobian": "current"}),
        ("no block 'torque' with action_mode = 'gain'; only with 'torque_rate'", {"observation": ["torque"]}),
    ],
    (RESIDUAL, ValueError): [(r"inner_damping: its fastest pole .* integration st", {"inner_damping": (1e9, 1e9)})],
}
MESSAGES = [(*kind, *row) for kind, rows in REFUSED.items() for row in rows]


@pytest.mark.parametrize(("env_id", "error", "message", "options"), MESSAGES, ids=label)
def test_a_wrong_option_fails_at_make(env_id: str, error: Any, message: str, options: dict[str, Any]) -> None:
    with pytest.raises(error, match=message):
        make(env_id, **options) if "render_mode" not in options else FlexArmEnv(**options)


# The modes in which an option acts; in the others it must not be given.
ACTS_IN = {
    "torque_rate_limit": ("torque_rate", (1.0, 1.0)),
    "gain_limit": ("gain", 2.0),
    "shift_limit": ("reference", (0.1, 0.1)),
    "inner_stiffness": ("residual reference", (1.0, 1.0)),
    "inner_damping": ("residual reference", (1.0, 1.0)),
    "proportional_gain": ("gain", 1.0),
    "derivative_gain": ("gain", 1.0),
    "compensation": ("gain", "shared"),
    "feedback_source": ("gain", "sensor"),
    "rate_jacobian": ("gain", "current"),
    "delayed": ("gain", "position+rate"),
    "race_laps": ("race", 2),
    "reference_speed": ("race", 10.0),
    "reference_acceleration": ("race", 10.0),
}


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("name", ACTS_IN)
def test_an_option_without_effect_is_refused(name: str, mode: str) -> None:
    allowed, value = ACTS_IN[name]
    late = {"feedback_source": "sensor", "sensor": "rigid"} if mode == "gain" else {}
    late |= {"start": "corner"} if mode == "race" else {}
    options = {"action_mode": mode, **late, name: value}
    if mode in allowed.split():
        assert getattr(Settings.of(options), name) == value
    else:
        with refuses(ValueError, f"{name} = {value!r}: has no effect", f"'{mode}'", *map(repr, allowed.split())):
            Settings.of(options)


def test_the_sensor_is_at_the_tip_of_whatever_link() -> None:
    assert FlexArmEnv(arm={"link_lengths": (3.0, 2.0)}, side=4.0, reference="line").settings.sensor_position == 2.0
    assert FlexArmEnv(sensor_position=None).settings == FlexArmEnv(sensor_position=4.5).settings


def test_type_checkers_know_the_options() -> None:
    assert environments.TYPES.read_text() == environments.types(), "run: python -m scripts.docs.environments"


def test_lists_as_json_has_them_are_tuples() -> None:
    settings = Settings.of({"previews": [0.1], "torque_limit": [1.0, 2.0], "delay": [0.1, 0.2], "sensor": "rigid"})
    assert (settings.previews, settings.torque_limit, settings.reference) == ((0.1,), (1.0, 2.0), ("square",))
    assert settings.delay == settings.sensor_parameters.delay == (0.1, 0.2)


def test_numbers_of_numpy_are_numbers() -> None:
    given = {"delay": np.array(0.01), "noise": np.float32(0.5), "sensor": np.array("true"), "scaled": np.array(False)}
    settings = Settings.of(given | {"previews": np.array([0.1, 0.2]), "last_actions": np.int8(3)})
    assert (settings.delay, settings.noise, settings.sensor, settings.scaled) == (0.01, 0.5, "true", False)
    assert (settings.previews, settings.last_actions) == ((0.1, 0.2), 3)
    assert {type(x) for x in (settings.delay, settings.noise, *settings.previews)} == {float}
    assert (type(settings.sensor), type(settings.scaled), type(settings.last_actions)) == (str, bool, int)


@pytest.mark.parametrize(
    ("option", "near"),
    [("frameskip", "'frame'"), ("sensor_delay", "'delay' or 'sensor' or 'second_sensor_delay'")],
)
def test_an_unknown_option_is_refused_in_pythons_words(option: str, near: str) -> None:
    """TorchRL looks for these."""
    expected = rf"__init__\(\) got an unexpected keyword argument '{option}'; did you mean {near}\?"
    for made in (lambda: make(**{option: 1}), lambda: gym.make_vec(SQUARE, num_envs=2, **{option: 1})):
        with pytest.raises(TypeError, match=expected) as caught:
            made()
        assert len(str(caught.value)) < 250


@pytest.mark.parametrize("name", [one.name for one in fields(Settings)])
def test_what_an_option_may_be(name: str) -> None:
    """Its declaration refuses all else; those that a function checks have their messages in `MESSAGES`."""
    wrong = wrong_values(name, allowed_of(Settings, name))
    assert wrong or any(name in options for *_, options in MESSAGES)
    for value, error, message in wrong:
        with refuses(error, message):
            Settings.of({name: value})

"""Options: what is refused, with which words."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from flexarm_env.actions import MODES
from flexarm_env.envs.settings import Settings
from flexarm_env.envs.single import FlexArmEnv
from tests.support.envs import GAIN, PAPER, RESIDUAL, SQUARE, WAYPOINTS, make
from tests.support.refusals import label, refuses

MISMATCHED = {"masses_per_length": (1e-9, 1e-9), "payload_inertia": 1e9}
ON_LINK_1 = {"observation": ["second_sensor_error"], "second_sensor_link": 1}
MESSAGES: list[tuple[str, dict[str, Any], type[Exception], str]] = [
    (SQUARE, {"arm": "papers"}, ValueError, r"arm = 'papers': must be one of 'default', 'linear', 'paper'"),
    (
        SQUARE,
        {"arm": 2},
        TypeError,
        r"arm = 2: must be one of 'default', 'linear', 'paper' or a mapping of ArmParameters fields",
    ),
    (SQUARE, {"arm": {"mass": 1.0}}, ValueError, r"arm: unknown field\(s\) \['mass'\]; ArmParameters has .*'link_le"),
    (SQUARE, {"arm": {"modes_per_link": 5}}, ValueError, r"modes_per_link = 5: must be an integer from 1 to 4"),
    (SQUARE, {"arm": {"preset": "new"}}, ValueError, r"arm = 'new': must be one of 'default', 'linear', 'paper'"),
    (
        SQUARE,
        {"action_mode": "torque_rate", "torque_rate_limit": (0.0, 1.0)},
        ValueError,
        r"torque_rate_limit\[0\] = 0\.0: must be",
    ),
    (SQUARE, {"physics_step": 0.02}, ValueError, r"physics_step = 0\.02 s: too long .* 323 rad/s; at most 0\.00619"),
    (PAPER, {"physics_step": 0.1}, ValueError, r"physics_step = 0\.1 s: too long .* at most 0\.01218 s is allowed"),
    (
        RESIDUAL,
        {"action_mode": "reference", "shift_limit": (0.1, 4.0)},
        ValueError,
        r"shift_limit\[1\] = 4\.0: must be .* >= 1e-06 and <= 3\.14\d* \[rad\]",
    ),
    (
        PAPER,
        {"sensor": "collocated", "compensation": "shared"},
        ValueError,
        r"compensation = 'shared': .* must be 'none'",
    ),
    (
        GAIN,
        {"compensation": "shared"},
        ValueError,
        r"compensation = 'shared': has no effect here; only with law_sensor = 'sensor'",
    ),
    (
        GAIN,
        {"delayed": "position+rate"},
        ValueError,
        r"delayed = 'position\+rate': has no effect here; only with law_sensor",
    ),
    (
        GAIN,
        {"rate_jacobian": "current"},
        ValueError,
        r"rate_jacobian = 'current': has no effect here; only with law_sensor",
    ),
    (PAPER, {"jitter": 0.01}, ValueError, r"jitter = 0\.01: .* must be 0 with law_sensor = 'sensor'"),
    (PAPER, {"hold": 0.02}, ValueError, r"hold = 0\.02: .* must be 0 with law_sensor = 'sensor'"),
    (PAPER, {"dropout": 0.5}, ValueError, r"dropout = 0\.5: .* must be 0 with law_sensor = 'sensor'"),
    (SQUARE, {"sensor_position": 4.6}, ValueError, r"sensor_position = 4\.6 m: must be on link 2, > 0 and <= 4\.5 m"),
    (SQUARE, {"delay": -1e-3}, ValueError, r"delay = -0\.001: must be .* >= 0\.0 and <= 10\.0 \[s\]"),
    (PAPER, {"delay": (0.01, math.inf)}, ValueError, r"delay\[1\] = inf: must be .* \[s\]"),
    (SQUARE, {"delay": "late"}, TypeError, r"delay = 'late': must be a .* \[s\]"),
    (SQUARE, {"delay": (0.1, 0.2)}, ValueError, r"delay = .* one number \[s\].*randomisation=.'delay': \(0\.1, 0\.2\)"),
    (
        SQUARE,
        {"arm": {"link_lengths": (3.0, 3.0)}, "sensor_position": 4.0},
        ValueError,
        r"sensor_position = 4\.0 m: .*; side = 12\.6 m: ",
    ),
    (SQUARE, {"sensor": "collocated", "delay": 0.1}, ValueError, r"delay = 0\.1: .* must be None"),
    (SQUARE, {"hold": -1.0}, ValueError, r"hold = -1\.0: must be .* >= 1e-06 and <= 10\.0 \[s\]"),
    (SQUARE, {"hold": 1e-311}, ValueError, r"hold = 1e-311: must be .* >= 1e-06 and <= 10\.0 \[s\]"),
    (SQUARE, {"observation": ["tip"]}, ValueError, r"observation = 'tip': must be one of 'joint_angles', "),
    (SQUARE, {"observation": []}, ValueError, r"observation = \[\]: must hold at least one name, and each only once"),
    (SQUARE, {"observation": ["lap_phase"] * 2}, ValueError, r"observation = .*: must hold .* each only once"),
    (SQUARE, {"observation": "lap_phase"}, TypeError, r"observation = 'lap_phase': must be a list or a tuple"),
    (SQUARE, {"observation": [1]}, TypeError, r"observation = \[1\]: must hold names"),
    (SQUARE, {"previews": 0.1}, TypeError, r"previews = 0\.1: must be a list or a tuple"),
    (SQUARE, {"previews": (0.1, 0.0)}, ValueError, r"previews\[1\] = 0\.0: must be .* >= 1e-06 .* \[s\]"),
    (SQUARE, {"reference": "heart"}, ValueError, r"reference = 'heart': must be one of 'square', 'circle', .*'moves'"),
    (SQUARE, {"reference": abs}, TypeError, r"reference = <built-in .*'circle', .*waypoints=\[\(x, y\), \.\.\.\]"),
    (SQUARE, {"reference": ["square", "moves"]}, ValueError, r"reference = 'moves': must be one of .*'waypoints'$"),
    (SQUARE, {"reference": "waypoints"}, ValueError, r"waypoints = None: must be given with the reference 'waypoints'"),
    (SQUARE, {"waypoints": WAYPOINTS}, ValueError, r"waypoints = .*only with it; reference = \('square',\)"),
    (
        SQUARE,
        {"reference": "waypoints", "waypoints": [(1.0, 1.0)]},
        ValueError,
        r"waypoints: must be at least 2 points",
    ),
    (
        SQUARE,
        {"reference": "waypoints", "waypoints": [(9.0, 9.0), (0.0, 1.0)]},
        ValueError,
        r"way-point .* misses it by",
    ),
    (SQUARE, {"side": 12.8}, ValueError, r"path: way-point .* misses it by 0\.05097 m"),
    (
        SQUARE,
        {"randomisation": {"mass": (0.0, 1.0)}},
        ValueError,
        r"randomisation\['mass'\]: no such quantity; there are 'delay'",
    ),
    (
        SQUARE,
        {"randomisation": {"delay": 0.1}},
        TypeError,
        r"randomisation\['delay'\] = 0\.1: must be a pair of numbers",
    ),
    (
        SQUARE,
        {"randomisation": {"stiffness": (0.0, 1.0)}},
        ValueError,
        r"\['stiffness'\]\[0\] = 0\.0: must be .* >= 0\.1",
    ),
    (
        SQUARE,
        {"randomisation": {"noise": (0.2, 0.1)}},
        ValueError,
        r"\['noise'\] = .*the first must not be above the sec",
    ),
    (SQUARE, {"randomisation": [1]}, TypeError, r"randomisation = \[1\]: must be a mapping of names"),
    (
        SQUARE,
        {"randomisation": {"delay": (0.0, 0.1)}, "sensor": "collocated"},
        ValueError,
        r"randomisation\['delay'\]: a collocated sensor has no delay",
    ),
    (
        SQUARE,
        {"reward_weights": {"speed": 1.0}},
        ValueError,
        r"reward_weights\['speed'\]: no such term; there are 'tracking_wide'",
    ),
    (
        SQUARE,
        {"reward_weights": {"effort": -1.0}},
        ValueError,
        r"reward_weights\['effort'\] = -1\.0: must be .* >= 0\.0",
    ),
    (SQUARE, {"reward_weights": {"effort": 0.0}}, ValueError, r"reward_weights = .*: one at least must be > 0"),
    (SQUARE, {"reward_weights": 1.0}, TypeError, r"reward_weights = 1\.0: must be a mapping of names"),
    (
        SQUARE,
        {"physics_step": 1e-9},
        ValueError,
        r"physics_step = 1e-09 s: 1e\+07 integration steps .*at most 20000 are",
    ),
    (SQUARE, {"arm": {"payload_inertia": 1e30}}, ValueError, r"payload_inertia = 1e\+30: must be .* \[kg m\^2\]"),
    (SQUARE, {"arm": {"mode_scale": 1e-300}}, ValueError, r"mode_scale = 1e-300: must be .* >= 0.001"),
    (SQUARE, {"arm": {"payload_mass": 1e300}}, ValueError, r"payload_mass = 1e\+300: must be .* \[kg\]"),
    (SQUARE, {"arm": {"joint_friction": (1e300, 0)}}, ValueError, r"joint_friction\[0\] = 1e\+300: must be"),
    (
        SQUARE,
        {"arm": {"joint_friction": (1e6, 1e6)}},
        ValueError,
        r"arm = .*friction.*rad/s.* integration steps in con",
    ),
    (
        SQUARE,
        {"arm": {"masses_per_length": (1e-12, 1)}},
        ValueError,
        r"masses_per_length\[0\] = 1e-12: must be .* >= 1",
    ),
    (
        SQUARE,
        {"arm": MISMATCHED},
        ValueError,
        r"arm: its masses and inertias lie too far apart .*payload_inertia = 1000",
    ),
    (RESIDUAL, {"inner_resistance": (1e9, 1e9)}, ValueError, r"inner_resistance: its fastest pole .* integration st"),
    (
        SQUARE,
        {"delay": 10.0, "physics_step": 1e-6},
        ValueError,
        r"delay = 10\.0 s, .* readings to keep, .*at most 2000000",
    ),
    (
        SQUARE,
        {"action_mode": "reference", "actuation_delay": 0.005},
        ValueError,
        "actuation_delay = 0.005 s: must be a whole number",
    ),
    (
        SQUARE,
        {"observation": ("joint_rates",), "previews": (0.1,)},
        ValueError,
        "previews = \\(0.1,\\): has no effect here",
    ),
    (SQUARE, {"observation": ("joint_rates",), "last_actions": 3}, ValueError, "last_actions = 3: has no effect here"),
    (SQUARE, {"previews": ()}, ValueError, "previews = "),
    (SQUARE, {"delay": 0.01, "wave_speed": 100.0}, ValueError, "wave_speed = 100.0: has no effect here"),
    (SQUARE, {"sensor": "collocated", "jitter": 0.01}, ValueError, "jitter = 0.01: has no effect here"),
    (SQUARE, {"start": "corner", "start_spread": (0.1, 0.1)}, ValueError, "start_spread = .*: has no effect here"),
    (SQUARE, {"reference": "moves", "side": 8.0}, ValueError, "side = 8.0: has no effect here"),
    (
        SQUARE,
        {"reference": "moves", "lap_time": 0.2},
        ValueError,
        "lap_time = 0.2 s: must be at least 40 control periods",
    ),
    (SQUARE, {"lap_time": 0.3}, ValueError, "start = 'mix' with lap_time = 0.3 s"),
    (
        SQUARE,
        {"randomisation": {"payload_mass": (0.0, 1000000000.0)}},
        ValueError,
        "randomisation\\['payload_mass'\\]\\[1\\] = 1000000000.0",
    ),
    (
        GAIN,
        {"observation": ["torque"]},
        ValueError,
        "no block 'torque' with action_mode = 'gain'; only with 'torque_rate'",
    ),
    (SQUARE, {"second_sensor_link": 1}, ValueError, r"second_sensor_link = 1: has no effect here; .*'second_sensed_po"),
    (
        SQUARE,
        {"second_sensor_position": 1.0},
        ValueError,
        r"second_sensor_position = 1\.0: has no .*second_sensor_link",
    ),
    (SQUARE, {"second_sensor_delay": 0.1}, ValueError, r"second_sensor_delay = 0\.1: has no .*second_sensor_link"),
    (SQUARE, {"second_sensor_noise": 0.1}, ValueError, r"second_sensor_noise = 0\.1: has no .*second_sensor_link"),
    (
        SQUARE,
        ON_LINK_1 | {"second_sensor_position": 4.6},
        ValueError,
        r"second_sensor_position = 4\.6 m: .*link 1, .*4\.5",
    ),
    (SQUARE, ON_LINK_1 | {"second_sensor_delay": 10.1}, ValueError, r"second_sensor_delay = 10\.1: must be .* <= 10"),
    (SQUARE, ON_LINK_1 | {"second_sensor_noise": -1.0}, ValueError, r"second_sensor_noise = -1\.0: must be .* >= 0"),
    (
        SQUARE,
        {"observation": ["second_sensor_error"]},
        ValueError,
        r"observation block 'second_sensor_error': there is no second sensor; give second_sensor_link",
    ),
    (SQUARE, {"imu_link": 1}, ValueError, r"imu_link = 1: has no effect here; .*'accelerometer' or 'gyro'"),
    (SQUARE, {"imu_bias": (0.1, 0.1)}, ValueError, r"imu_bias = .*: has no .* an IMU: imu_link = 1 or 2"),
    (SQUARE, {"observation": ["gyro"]}, ValueError, r"observation block 'gyro': there is no IMU; give imu_link"),
    (
        SQUARE,
        {"hold": 1e-6, "jitter": 1.0},
        ValueError,
        r"hold = 1e-06 s: more than 20000 of the sensor's ticks in jit",
    ),
    (
        SQUARE,
        {"torque_limit": memoryview(b"ab")},
        TypeError,
        r"torque_limit = <memory at .*: must be a pair of numbers",
    ),
    (SQUARE, {"sensor": np.array([0.1, 0.1])}, ValueError, r"sensor = array\(\[0\.1, 0\.1\]\): must be one of 'collo"),
    (SQUARE, {"reward_weights": {"effort": 1e308}}, ValueError, r"\['effort'\] = 1e\+308: must be .* <= 1000000000000"),
    (SQUARE, {"render_mode": "ansi"}, ValueError, r"render_mode = 'ansi': must be one of 'rgb_array', 'human'"),
    (
        SQUARE,
        {"wind": 3.0},
        TypeError,
        r"FlexArmEnv\.__init__\(\) got an unexpected keyword argument 'wind'; see help\(FlexArmEnv\)",
    ),
    (SQUARE, {"torque_limits": (1.0, 1.0)}, TypeError, r"argument 'torque_limits'; did you mean 'torque_limit'\?"),
    (PAPER, {"gainlimit": 1.0}, TypeError, r"keyword argument 'gainlimit'; did you mean 'gain_limit'\?"),
]


@pytest.mark.parametrize(("env_id", "options", "error", "message"), MESSAGES, ids=label)
def test_a_wrong_option_fails_at_make(
    env_id: str, options: dict[str, Any], error: type[Exception], message: str
) -> None:
    """Naming the option, its value and what is allowed."""
    with pytest.raises(error, match=message):
        make(env_id, **options) if "render_mode" not in options else FlexArmEnv(**options)


# The modes in which an option acts; in the others it must not be given.
ACTS_IN = {
    "torque_rate_limit": ("torque_rate", (1.0, 1.0)),
    "gain_limit": ("gain", 2.0),
    "shift_limit": ("reference", (0.1, 0.1)),
    "inner_stiffness": ("residual reference", (1.0, 1.0)),
    "inner_resistance": ("residual reference", (1.0, 1.0)),
    "proportional_gain": ("gain", 1.0),
    "derivative_gain": ("gain", 1.0),
    "compensation": ("gain", "shared"),
    "law_sensor": ("gain", "sensor"),
    "rate_jacobian": ("gain", "current"),
    "delayed": ("gain", "position+rate"),
}


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("name", ACTS_IN)
def test_an_option_without_effect_is_refused(name: str, mode: str) -> None:
    allowed, value = ACTS_IN[name]
    late = {"law_sensor": "sensor", "sensor": "rigid"} if mode == "gain" else {}
    options = {"action_mode": mode, **late, name: value}
    if mode in allowed.split():
        assert getattr(Settings.of(options), name) == value
    else:
        with refuses(ValueError, f"{name} = {value!r}: has no effect", f"'{mode}'", *map(repr, allowed.split())):
            Settings.of(options)


def test_the_sensor_is_at_the_tip_of_whatever_link() -> None:
    assert FlexArmEnv(arm={"link_lengths": (3.0, 2.0)}, side=4.0, reference="line").settings.sensor_position == 2.0
    assert FlexArmEnv(sensor_position=None).settings == FlexArmEnv(sensor_position=4.5).settings

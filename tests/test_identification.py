"""Identification: derivatives, estimates and their intervals, recordings as files, and what is refused."""

import json
import logging
from dataclasses import replace
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from scipy.stats import binom

from flexarm_agents.commands.identify import run
from flexarm_env import ArmParameters, FlexibleArm
from flexarm_env.identification import Recording, identify, record, simulated
from flexarm_env.identification.fit import Fit
from flexarm_env.identification.model import Model
from flexarm_env.identification.recording import CHANNELS
from tests.support.envs import bare
from tests.support.refusals import refused

ARM = ArmParameters(payload_mass=0.4, damping_ratio=0.015, joint_friction=(2.0, 1.0))
PERIOD, LATE, MOTORS = 0.01, 0.0187, 0.0042
TIME = PERIOD * np.arange(80)
TORQUE = np.stack(
    [30 * np.sin(7 * TIME) + 20 * np.sign(np.sin(19 * TIME)), 12 * np.sin(12 * TIME) + 8 * np.sign(np.sin(27 * TIME))],
    1,
)
START = np.zeros(16)
START[1] = 0.8
SCALE = {"joint": 1e-3, "deflection": 3e-3, "tip": 5e-3}


@pytest.fixture(scope="module")
def clean() -> Recording:
    """Return what sensors without noise read of `ARM`."""
    return simulated(ARM, START, TORQUE, PERIOD, delay=LATE, actuation_delay=MOTORS)


@pytest.fixture(scope="module")
def half(clean: Recording) -> Recording:
    """Return the first half of it."""
    return replace(clean, **{name: getattr(clean, name)[:40] for name in ("torque", *CHANNELS)})


def noisy(clean: Recording, seed: int) -> Recording:
    rng = np.random.default_rng(seed)
    return replace(clean, **{n: getattr(clean, n) + SCALE[n] * rng.normal(size=TORQUE.shape) for n in CHANNELS})


def test_readings_are_those_of_the_simulated_arm(clean: Recording) -> None:
    """Seen at a time step that divides the delays. A spline smooths a step of the torque over a node of 2.5 ms."""
    arm = FlexibleArm(ARM)
    path = arm.simulate(START, np.repeat(TORQUE, 100, axis=0), 0.8, step=1e-4)
    when = np.round((TIME[3:] - MOTORS) / 1e-4).astype(int)
    np.testing.assert_allclose(clean.joint[3:], path.state[when, :2], atol=1e-4)  # type: ignore[index]
    np.testing.assert_allclose(clean.deflection[3:], arm.tip_deflection(path.state[when, :8]), atol=1e-3)  # type: ignore[index]
    when = np.round((TIME[3:] - MOTORS - LATE) / 1e-4).astype(int)
    np.testing.assert_allclose(clean.tip[3:], path.tip[when], atol=1e-3)  # type: ignore[index]
    assert np.isnan(clean.tip[:3]).all()  # type: ignore[index]


def test_derivatives_are_those_of_the_residuals(clean: Recording) -> None:
    names = ["payload_mass", "joint_friction_2", "link_lengths_1", "actuation_delay", "delay"]
    measured = {n: getattr(clean, n)[None, :20] for n in CHANNELS}
    model = Model(names, TORQUE[None, :20], PERIOD, {"delay": 0.0, "actuation_delay": 0.0}, 4.5)
    fit = Fit(model, ARM, names, measured, dict.fromkeys(CHANNELS, 1.0))
    at = np.concatenate([[0.4, 1.0, 4.5, MOTORS, LATE], START])

    def flat(unknown: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
        return np.concatenate([left.ravel() for left in fit.left(unknown).values()])

    slopes = np.concatenate([s[..., : at.size].reshape(-1, at.size) for _, s in fit.parts(at).values()])
    for n in (0, 1, 2, 3, 4, 6, 9, 20):
        change = 1e-5 * np.eye(at.size)[n] * max(abs(at[n]), 1e-2)
        expected = (flat(at + change) - flat(at - change)) / (2.0 * change[n])
        known = np.isfinite(expected)
        scale = np.abs(expected[known]).max()
        np.testing.assert_allclose(slopes[known, n], expected[known], atol=1e-5 * scale)  # differences of differences


def test_values_without_noise_are_found(half: Recording) -> None:
    start = replace(ARM, payload_mass=0.1, damping_ratio=0.03)
    names = ["payload_mass", "damping_ratio", "delay", "actuation_delay"]
    found = identify([half], start, names, delay=0.01, window=0.2)
    expected = [0.4, 0.015, LATE, MOTORS]
    np.testing.assert_allclose(list(found.values.values()), expected, rtol=1e-3)
    assert (found.arm.payload_mass, found.arm.joint_friction) == (found.values["payload_mass"], (2.0, 1.0))


def test_the_end_of_a_recording_counts() -> None:
    """What is told after the last whole window, and gauges that always read the same."""
    torque = np.concatenate([np.zeros((20, 2)), TORQUE[:15]])
    arm = ArmParameters(payload_mass=0.4, modes_per_link=1)
    run = Recording(PERIOD, torque, simulated(arm, np.zeros(8), torque, PERIOD).joint)
    still = replace(run, deflection=np.zeros_like(torque))
    first = replace(arm, payload_mass=0.1)
    plain, other = (identify([one], first, ["payload_mass"], window=0.2) for one in (run, still))
    assert plain.values["payload_mass"] == pytest.approx(0.4, rel=1e-3)
    assert other.explained["deflection"] == 0.0


def test_a_search_may_begin_at_the_end_of_a_range() -> None:
    arm = ArmParameters(damping_ratio=1.0, modes_per_link=1)
    found = identify([simulated(arm, np.zeros(8), TORQUE[:20], PERIOD)], arm, ["damping_ratio"])
    assert found.values["damping_ratio"] == pytest.approx(1.0, rel=2e-4)


@pytest.mark.slow
def test_intervals_of_95_percent_hold_true_values_as_often() -> None:
    """In 100 recordings; counts that 95 % give less often than once in 10,000 are refused."""
    names = {"payload_mass": 0.4, "damping_ratio": 0.015, "joint_friction_2": 1.0}
    clean = simulated(ARM, START, TORQUE, PERIOD)
    held = dict.fromkeys(names, 0)
    for seed in range(100):
        found = identify([noisy(clean, seed)], ARM, list(names))
        for name, (low, high) in found.intervals.items():
            held[name] += low <= names[name] <= high
    logging.getLogger(__name__).info("true values within their intervals, of 100: %s", held)
    fewest, most = binom.ppf([0.5e-4, 1.0 - 0.5e-4], 100, 0.95)
    assert all(fewest <= count <= most for count in held.values()), held


def test_a_file_holds_a_recording(tmp_path: Path, clean: Recording) -> None:
    clean.save(tmp_path / "run.csv")
    read = Recording.load(tmp_path / "run.csv")
    assert read.period == pytest.approx(PERIOD)
    for name in ("torque", *CHANNELS):
        np.testing.assert_allclose(getattr(read, name), getattr(clean, name), atol=1e-8)


def test_the_command_writes_what_it_finds(tmp_path: Path, half: Recording, capsys: pytest.CaptureFixture[str]) -> None:
    replace(half, tip=None).save(tmp_path / "run.csv")
    arm = json.dumps({"damping_ratio": 0.015, "joint_friction": [2.0, 1.0], "payload_mass": 0.3})
    known = ["--actuation-delay", str(MOTORS), "--output", str(tmp_path / "found.json")]
    run([str(tmp_path / "run.csv"), "--fit", "payload_mass", "--arm", arm, *known])
    assert json.loads((tmp_path / "found.json").read_text())["arm"]["payload_mass"] == pytest.approx(0.4, rel=1e-3)
    assert "payload_mass" in capsys.readouterr().out


def test_an_environment_is_recorded() -> None:
    blocks = ("sensed_position", "joint_angles")
    env = bare("FlexArm/Square-v0", scaled=False, frame="world", observation=blocks, arm={"modes_per_link": 1})
    run = record(env, TORQUE[:3], seed=1)
    env.reset(seed=1, options={"start": "corner"})
    for torque, joint in zip(TORQUE[:2], run.joint[1:], strict=True):  # type: ignore[index]
        observation = env.step((torque / (150.0, 50.0)).astype(np.float32))[0]
        np.testing.assert_array_equal(observation[2:], joint.astype(np.float32))
    assert run.channels == ("joint", "tip")


SOME = Recording(PERIOD, TORQUE[:4], joint=np.zeros((4, 2)))
LATE_TIP = replace(SOME, tip=np.full((4, 2), 4.0))
PLAIN = bare("FlexArm/Square-v0", scaled=False, frame="world")
ONE_MODE = ArmParameters(modes_per_link=1)


def fitted(recording: Recording = SOME, arm: ArmParameters = ARM, **options: float) -> Any:
    return lambda: identify([recording], arm, ["payload_mass"], **options)


def of_environment(**options: Any) -> Any:
    return lambda: record(bare("FlexArm/Square-v0", scaled=False, frame="world", **options), TORQUE)


test_bad_input_is_refused = refused(
    (lambda: identify([SOME], ARM, ["mass"]), "names = 'mass': must be one of"),
    (lambda: identify([SOME], ARM, []), r"names = \[\]: must hold at least one name"),
    (lambda: identify([SOME], ARM, "payload_mass"), "TypeError: names = 'payload_mass': must be a list"),
    (lambda: identify([], ARM, ["payload_mass"]), "recordings: must be one at least"),
    (lambda: identify([SOME, replace(SOME, period=0.02)], ARM, ["payload_mass"]), "the same period"),
    (fitted(delay=-1.0), "delay = -1.0"),
    (fitted(window=0.0), "window = 0.0"),
    (fitted(window=0.001), r"window = 0.001: must be .* >= 0\.02"),
    (fitted(sensor_position=9.0), "sensor_position = 9.0"),
    (fitted(LATE_TIP, delay=0.1), r"window: too short.*'tip'.*earlier"),
    (fitted(arm=ONE_MODE), "recordings: 8 readings for as many unknown numbers, 8; must be more"),
    (lambda: Recording(PERIOD, TORQUE[:4]), "without readings"),
    (lambda: Recording(PERIOD, TORQUE[:4], joint=np.zeros((3, 2))), r"joint: must have shape \(4, 2\)"),
    (lambda: Recording(PERIOD, TORQUE[:1], joint=np.zeros((1, 2))), r"torque: must have shape .*, got \(1, 2\)"),
    (lambda: Recording(PERIOD, 5.0, joint=np.zeros((4, 2))), r"torque: must have shape \(n, 2\), got \(\)"),
    (lambda: replace(SOME, tip=np.full((4, 2), np.nan)), "tip: must be finite, or NaN .* leave it out"),
    (lambda: replace(SOME, torque=TORQUE[:4] * [np.nan, 1.0]), r"torque\[0, 0\] = nan: must be finite"),
    (lambda: record(bare("FlexArm/Square-v0"), TORQUE), "scaled=False"),
    (lambda: record(PLAIN, np.zeros((0, 2))), r"torque: must have shape \(n, 2\), n at least 2, got \(0, 2\)"),
    (lambda: record(PLAIN, np.zeros((5, 3))), r"torque: must have shape \(n, 2\), got \(5, 3\)"),
    (lambda: record(gymnasium.make("CartPole-v1"), TORQUE), "TypeError: env = .*: must be a FlexArmEnv"),
    (of_environment(torque_resolution=(1, 1)), "ideal motors"),
    (of_environment(pulse_force=(1, 0)), "pulse_force = 0"),
    (of_environment(arm={"modes_per_link": 1}, error_limit=1e-3), r"env: its episode ended after 0\.01 s"),
)


def of_arm(**options: Any) -> Any:
    good = {"arm": ONE_MODE, "state": np.zeros(8), "torque": TORQUE[:4], "period": PERIOD}
    return lambda: simulated(**good | options)


def test_a_channel_whose_readings_are_all_earlier_is_left_out() -> None:
    assert of_arm(delay=1.0)().channels == ("joint", "deflection")


test_bad_input_of_simulated_is_refused = refused(
    (of_arm(actuation_delay=1.0), "a recording without readings"),
    (of_arm(delay=-0.1), r"delay = -0\.1: must be"),
    (of_arm(actuation_delay=np.nan), "actuation_delay = nan: must be"),
    (of_arm(actuation_delay="1"), "TypeError: actuation_delay = '1': must be"),
    (of_arm(period=0.0), r"period = 0\.0: must be"),
    (of_arm(sensor_position=9.0), r"sensor_position = 9\.0: must be"),
    (of_arm(torque=np.zeros(4)), r"torque: must have shape \(n, 2\), got \(4,\)"),
    (of_arm(state=np.zeros(7)), r"state: must have shape \(8,\), got \(7,\)"),
    (of_arm(arm=None), "TypeError: arm = None: must be an ArmParameters"),
)


@pytest.mark.parametrize("count", [2, 20])
def test_an_arm_that_diverges_is_named(count: int) -> None:
    """In the last step or before: no message is of a state that the user did not give."""
    with pytest.raises(FloatingPointError, match=r"^the arm's motion diverges before 0\.01 s"):
        of_arm(state=[1e12, 0.0, 0.0, 0.0, 100.0, 0.0, 0.0, 0.0], torque=np.zeros((count, 2)))()


HEAD = b"time,torque_1,torque_2,joint_1,joint_2\n"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (b"", r"missing \['time', 'torque_1', 'torque_2'\]"),
        (b"time,torque_1,joint_1,joint_2\n", r"missing \['torque_2'\], unknown \[\]"),
        (b"time,torque_1,torque_2,speed\n", r"missing \[\], unknown \['speed'\]"),
        (b"time,torque_1,torque_2,tip_1,joint_1,joint_2\n", r"missing \['tip_2'\], unknown \[\]"),
        (b"time,torque_1,torque_2\n0,0,0\n1,1,1\n2,2,2", "a recording without readings"),
        (b"0 0;0", "unknown"),
        (HEAD, "two rows of numbers at least, got 0"),
        (HEAD + b"0,1,1,0,0\n", "two rows of numbers at least, got 1"),
        (HEAD + b"0,1,1,0,0\n1,1,1,abc,0\n", "row 2 below the header, '1,1,1,abc,0': could not convert"),
        (HEAD + b"0,1,1,0,0\n1,1,1\n", "row 2 below the header, '1,1,1': must have 5 cells, has 3"),
        (b"time,time,torque_1,torque_2\n", r"unknown \['time'\]"),
        (bytes(range(128, 256)), "not a CSV file"),
    ],
)
def test_a_damaged_file_is_refused_with_its_name(tmp_path: Path, text: bytes, message: str) -> None:
    (tmp_path / "run.csv").write_bytes(text)
    with pytest.raises(ValueError, match=f"run.csv: .*{message}"):
        Recording.load(tmp_path / "run.csv")


def test_an_empty_cell_is_a_missing_reading(tmp_path: Path) -> None:
    (tmp_path / "run.csv").write_bytes(b"# " + HEAD + b"0,1,1,,2\r\n0.1,1,1,nan, 3\n\n")
    np.testing.assert_array_equal(Recording.load(tmp_path / "run.csv").joint, [[np.nan, 2.0], [np.nan, 3.0]])  # type: ignore[arg-type]

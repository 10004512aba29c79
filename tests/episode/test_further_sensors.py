"""Drivers of further sensors in plain Python: the delay line's slots, readings, and starts."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from numpy.typing import NDArray

from flexarm_env import ArmParameters, FlexibleArm, SquareParameters, inverse_kinematics, square
from flexarm_env.codegen.declarations import plain_python
from flexarm_env.envs.batch import BatchSimulator
from flexarm_env.envs.choices import DEFAULT_OBSERVATION
from flexarm_env.envs.sensors import SECOND
from flexarm_env.envs.settings import Settings
from flexarm_env.episode import sensor, step
from flexarm_env.episode.step import TORQUE, step_blocks
from flexarm_env.kernels import delay_line, entries, layout
from flexarm_env.kernels.entries import setting, word
from flexarm_env.kernels.layout import row
from flexarm_env.kernels.variants import Variant
from tests.support.envs import SQUARE, actions_for, bare, block
from tests.support.plain import KERNELS, block_of

Array = NDArray[np.float64]
ARM = FlexibleArm(ArmParameters.linear(modes_per_link=1, kinematics="foreshortened"))
SLOTS = 16
POINT = {1: 3.1, 2: 2.3}  # [m] from the link's root


@pytest.fixture(autouse=True)
def _quiet() -> Iterator[None]:
    """Lanes without a reading divide by zero, and keys overflow: as compiled."""
    with np.errstate(all="ignore"):
        yield


# --- the delay line ---------------------------------------------------------------------------------------------------


def state_at(time: float) -> Array:
    """Return a smooth motion of all coordinates, with its rates. Shape (8,)."""
    size, omega = np.array([0.6, 0.9, 0.4, 0.3]), np.array([20.0, 15.0, 25.0, 30.0])
    phase = omega * time + np.arange(4.0)
    return np.concatenate([size * np.sin(phase), size * omega * np.cos(phase)])


def variant_with(link: int) -> Variant:
    """One lane of the foreshortened arm with a second sensor."""
    return Variant(TORQUE, 1, True, 1, sensor="true", foreshortened=True, sensors=(("position", link),))


def arena_of(of: Variant, **parts: Any) -> Array:
    """Make an arena with some parts filled. Shape (rows, 1)."""
    arena = np.zeros((entries.extent(of.rows), 1))
    points = layout.place_rows("SENSOR_POINT", ARM.place(2, 4.5))
    for _, link in of.sensors:
        points |= layout.place_rows("FURTHER", ARM.place(link, POINT[link]))
        points |= {"FURTHER_LINK": [link], "FURTHER_RANGE": [np.inf] * 2}
    for name, values in {**layout.arm_rows(ARM.constants), **points, **parts}.items():
        first, count = of.rows[name]
        arena[first : first + count, 0] = values
    return arena


def put_state(of: Variant, arena: Array, time: float) -> None:
    """Write the motion's state at a time [s]."""
    internal = ARM.internal_state(state_at(time)[None])[0]
    for name, values in zip(("Y", "V"), np.split(internal, 2), strict=True):
        first, count = of.rows[name]
        arena[first : first + count, 0] = values


def seen(link: int, h: float, back: float) -> tuple[Array, Array]:
    """Return the reading at 0.08 s of what was `back` steps before, and where the point was. Shape (2,) each."""
    of, now = variant_with(link), round(0.08 / h)
    arena = arena_of(of, FURTHER_DELAY=[back * h] * 2)
    history = np.zeros((SLOTS * of.slot_rows, 1))
    clock = np.zeros((entries.CLOCK_ROWS, 1), dtype=np.int64)
    keys, who, path = np.zeros(1, dtype=np.uint64), np.ones(1, dtype=bool), np.array([[[0.0, 5.0, 5.0, 0.0, 0.0]] * 2])
    path[0, 1, 0] = 1.0
    header = np.zeros(word.PLACES, dtype=np.int64)
    settings = np.zeros(entries.extent(entries.Setting.layout(of.shape)))
    with plain_python(of):
        settings[setting.STEP], arena[row.BRANCH] = h, 1.0
        settings[setting.LENGTHS : setting.LENGTHS + 2] = ARM.parameters.link_lengths
        delay_line.count_steps(clock, history, now)
        for n in range(now + 1 - SLOTS, now + 1):
            put_state(of, arena, n * h)
            delay_line.store_reading(arena, history, n % SLOTS)
        arrays = {"arena": arena, "history": history, "clock": clock, "keys": keys, "paths": path}
        sensor.sense_further(block_of(**arrays, header=header, settings=settings, active=who))
        found = arena[row.FURTHER_READING : row.FURTHER_READING + 2, 0].copy()
    return found, ARM.position(state_at((now - back) * h)[:4], link, POINT[link])


@pytest.mark.parametrize("link", [1, 2])
def test_it_reads_where_its_point_was(link: int) -> None:
    """Exactly where a reading was kept; between two steps the cubic's error is of fourth order in the step."""
    for back in (0.0, 5.0, 11.0):
        found, expected = seen(link, 1e-3, back)
        np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-13)
    errors = []
    for h in (2e-3, 1e-3):
        found, expected = seen(link, h, 5.5)
        errors.append(np.abs(found - expected).max())
    # h^4 / 384 of the fourth derivative: up to 30^4 /s^4 times 5 m, so 1e-8 m at 1 ms
    assert 1e-11 < errors[1] < 1e-8
    assert errors[0] / errors[1] == pytest.approx(16.0, rel=0.25)


def test_a_slot_holds_both_sensors() -> None:
    """The first sensor's rows are those of a delay line without the second."""
    narrow, wide = Variant(TORQUE, 1, True, 1, sensor="true", foreshortened=True), variant_with(1)
    assert (narrow.slot_rows, wide.slot_rows) == (4, 8)
    slots = []
    for of in (narrow, wide):
        arena, history = arena_of(of), np.full((3 * of.slot_rows, 1), 7.0)
        put_state(of, arena, 0.03)
        with plain_python(of):
            delay_line.store_reading(arena, history, 1)
        slots.append(history.reshape(3, -1))
        assert (slots[-1][[0, 2]] == 7.0).all()
    np.testing.assert_array_equal(slots[1][1, :4], slots[0][1])
    state = state_at(0.03)
    np.testing.assert_allclose(slots[1][1, 4:6], ARM.position(state[:4], 1, POINT[1]), rtol=1e-13)
    np.testing.assert_allclose(slots[1][1, 6:], ARM.velocity(state, 1, POINT[1]), rtol=1e-12)


def test_one_sensor_has_no_rows_of_others() -> None:
    of = Variant(TORQUE, 1, True, 1)
    assert not [name for name in of.rows if "FURTHER" in name]
    with plain_python(of), pytest.raises(LookupError, match=r"Row\.FURTHER_DELAY"):
        _ = row.FURTHER_DELAY


# --- episodes ---------------------------------------------------------------------------------------------------------


class Plain:
    """Environments whose kernels run in plain Python."""

    def __init__(self, keys: list[int], **options: Any) -> None:
        settings = Settings.of({**gym.spec(SQUARE).kwargs, "arm": {"modes_per_link": 1}, **options})
        self.simulator = BatchSimulator(settings, len(keys))
        everyone = np.arange(len(keys))
        self.simulator.request_resets(np.array(keys, dtype=np.uint64), everyone, self.simulator.usual_requests)
        self.simulator._header[word.DRIVING] = 0
        self.run()
        self.simulator._header[word.DRIVING] = 1

    def run(self) -> None:
        with plain_python(self.simulator._variant):
            if len(self.simulator) == 1:
                assert step.step_only(self.simulator._memory)
            else:
                step_blocks(self.simulator._memory, 0, 1, np.empty((1, self.simulator._variant.lanes)))

    def step(self, actions: Array) -> None:
        self.simulator.actions[: len(self.simulator)] = actions
        self.run()

    def known(self, name: str) -> Array:
        """Part of the arena of each environment. Shape (N, count)."""
        first, count = self.simulator._rows[name]
        return self.simulator._arenas[0, first : first + count, : len(self.simulator)].T.copy()


@pytest.mark.parametrize("start", ["corners", "moving"])
def test_at_the_tip_it_reads_what_the_first_one_does(start: str) -> None:
    """Where both are equally late, to the last bit; the errors differ by the search for the reference only."""
    options = {"observation": ["second_sensor_error"], "second_sensor_link": 2}
    plain = Plain([5, 6], start=start, delay=0.0237, second_sensor_delay=0.0237, **options)
    for period in range(4):
        assert plain.known("FURTHER_READING").tobytes() == plain.known("LINK_SENSOR").tobytes(), period
        assert plain.known("F_FURTHER_READING").tobytes() == plain.known("F_LINK_SENSOR").tobytes(), (
            period
        )  # link's frame
        np.testing.assert_allclose(plain.known("FURTHER_ERROR"), plain.known("SENSOR_ERROR"), rtol=0.0, atol=1e-14)
        plain.step(np.full((2, 2), 0.3))
    assert np.abs(plain.known("LINK_SENSOR") - plain.known("TRUE_TIP")).max() > 1e-3


@pytest.mark.parametrize(("link", "place"), [(1, 4.5), (1, 2.0), (2, 3.0)])
def test_a_start_on_the_move_has_a_past(link: int, place: float) -> None:
    """The reading is where the reference's motion puts the point, moved by what the arm is off it; so is the error."""
    delay = 0.037
    plain = Plain(
        [5],
        start="moving",
        elbow_branch="positive",
        observation=["second_sensor_error"],
        second_sensor_link=link,
        second_sensor_position=place,
        second_sensor_delay=delay,
    )
    time, path = plain.known("START_TIME").item(), square(SquareParameters())

    def on_reference(moment: float) -> Array:
        theta1, theta2 = inverse_kinematics(ARM.parameters, path.position(np.array([moment]))[0], "positive")
        point = np.array([np.cos(theta1), np.sin(theta1)]) * (place if link == 1 else 4.5)
        return point + (link == 2) * place * np.array([np.cos(theta1 + theta2), np.sin(theta1 + theta2)])

    arm = plain.simulator.settings.flexible_arm
    present = arm.position(plain.known("STATE")[0, : arm.size], link, place)
    past = on_reference(time - delay)
    # whole steps back, so nothing is interpolated
    np.testing.assert_allclose(plain.known("FURTHER_READING")[0], present + past - on_reference(time), atol=1e-9)
    np.testing.assert_allclose(plain.known("FURTHER_ERROR")[0], on_reference(time) - present, atol=1e-9)


def test_an_arm_at_rest_on_the_reference_has_no_error() -> None:
    options = {"observation": ["second_sensed_position"], "second_sensor_link": 1, "second_sensor_delay": 0.2}
    plain = Plain([5], start="corner", **options)
    state = plain.known("STATE")[0]
    np.testing.assert_allclose(plain.known("FURTHER_READING")[0], ARM.position(state[:4], 1, 4.5), rtol=1e-13)
    assert np.abs(plain.known("FURTHER_ERROR")).max() < 1e-13


# --- environments ----------------------------------------------------------------------------------------------------

BOTH = ("sensed_position", *DEFAULT_OBSERVATION, *SECOND.blocks)
ON_LINK_1: dict[str, Any] = {"observation": BOTH, "second_sensor_link": 1}


def test_the_delay_line_is_long_enough_for_either_sensor() -> None:
    usual = Settings.of({})
    assert Settings.of(ON_LINK_1).history_slots == usual.history_slots
    longest = Settings.of(ON_LINK_1 | {"second_sensor_delay": 0.5})
    assert longest.history_slots * longest.control_period / longest.substeps >= 0.52


@pytest.mark.parametrize("kernels", KERNELS, indirect=True)
def test_readings_in_an_environment(kernels: str) -> None:
    """The point of link 1 as late as it is, in the link's frame, with noise of its own; nothing else changes."""
    options = {"noise": 0.01, "encoder_noise": (1e-3, 1e-2), "frame": "world", "scaled": False, "start": "moving"}
    quiet = bare(**ON_LINK_1, **options, second_sensor_delay=0.02)
    noisy = bare(**ON_LINK_1, **options, second_sensor_delay=0.02, second_sensor_noise=0.05)
    without = bare(observation=BOTH[:-2], **options)
    actions = 0.2 * actions_for(quiet, 300)
    runs = []
    for env in (quiet, noisy, without):
        rows = [env.reset(seed=3), *(env.step(action)[::4] for action in actions)]
        runs.append((np.array([row[0] for row in rows], dtype=float), [row[1] for row in rows]))
    # what does not concern the second sensor keeps its bits, its noise included
    shared = runs[2][0].shape[1]
    np.testing.assert_array_equal(runs[0][0][:, :shared], runs[2][0])
    np.testing.assert_array_equal(runs[1][0][:, :shared], runs[2][0])
    assert "second_sensed" not in runs[2][1][0]
    states = np.array([info["state"] for info in runs[0][1]])
    points = quiet.arm.position(states[:, : quiet.arm.size], 1, 4.5)
    seen = np.array([info["second_sensed"] for info in runs[0][1]])
    np.testing.assert_allclose(seen[2:], points[:-2], rtol=0.0, atol=1e-12)  # two periods: nothing is interpolated
    np.testing.assert_allclose(block(quiet, runs[0][0], "second_sensed_position"), seen, rtol=1e-6, atol=1e-6)
    difference = np.array([info["second_sensed"] for info in runs[1][1]]) - seen
    assert difference.std(axis=0) == pytest.approx([0.05, 0.05], rel=0.1)
    assert np.abs(difference.mean(axis=0)).max() < 0.01
    assert abs(np.corrcoef(*difference.T)[0, 1]) < 0.15
    of_first = np.array([info["sensed"] for info in runs[0][1]]) - quiet.arm.tip(states[:, : quiet.arm.size])
    assert abs(np.corrcoef(difference[1:, 0], np.diff(of_first[:, 0]))[0, 1]) < 0.15

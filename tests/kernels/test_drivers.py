"""Drivers in plain Python: the parts by hand, all of them together against what is compiled."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

from flexarm_env import ArmParameters, FlexibleArm
from flexarm_env.codegen.declarations import plain_python
from flexarm_env.envs.batch import BatchSimulator
from flexarm_env.envs.settings import Settings
from flexarm_env.episode import reset, sensor
from flexarm_env.episode.step import GAIN, TORQUE
from flexarm_env.kernels import (
    delay_line,
    entries,
    layout,
)
from flexarm_env.kernels.entries import drawn, setting, word
from flexarm_env.kernels.layout import row
from flexarm_env.kernels.variants import Variant, variant
from tests.support.envs import PAPER, RESIDUAL, SQUARE
from tests.support.plain import block_of, run_plainly

LANES = 3
ARM = FlexibleArm(ArmParameters.linear(modes_per_link=1))
STEP = 1e-3
SLOTS = 7


@pytest.fixture(autouse=True)
def _quiet() -> Iterator[None]:
    """Lanes without a reading divide by zero, and keys overflow: as compiled."""
    with np.errstate(all="ignore"):
        yield


def settings_of(env_id: str, **options: Any) -> Settings:
    """Return what an environment is made of."""
    return Settings.of({**gym.spec(env_id).kwargs, **options})


def arena_of(of: Variant, **parts: Any) -> np.ndarray:
    """Make an arena with some parts filled, each of shape (count,) or (count, lanes). Shape (rows, lanes)."""
    arena = np.zeros((entries.extent(of.rows), of.lanes))
    for name, values in {**layout.arm_rows(ARM.constants), **parts}.items():
        first, count = of.rows[name]
        arena[first : first + count] = np.reshape(values, (count, -1))
    return arena


# --- the parts by hand ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("node", [0.0, 0.5, 1.0])
def test_a_cubic_comes_back_from_the_delay_line(node: float) -> None:
    """A cubic and its rate come back exactly from past steps; a parabola from the step at hand."""
    late = np.array([[1.0, 1.25, 2.0], [3.75, 0.0, 0.4]]) * STEP
    curves = [np.polynomial.Polynomial([1.0, -30.0, 4e3, 9e5]), np.polynomial.Polynomial([-2.0, 50.0, 7e3])]
    with plain_python(Variant(GAIN, 1, True, LANES)):
        arena = arena_of(Variant(GAIN, 1, True, LANES), DELAY=late, RATE_LATE=1.0)
        clock = np.zeros((entries.CLOCK_ROWS, LANES), dtype=np.int64)
        history = np.zeros((4 * SLOTS, LANES))
        delay_line.count_steps(clock, history, 61)
        for step in range(62 - SLOTS, 62):
            for j, curve in enumerate(curves):
                history[4 * (step % SLOTS) + j] = curve(step * STEP)
                history[4 * (step % SLOTS) + 2 + j] = curve.deriv()(step * STEP)
        delay_line.prepare_readings(block_of(arena=arena, history=history, clock=clock), STEP, node)
        time = (61 + node) * STEP
        for j, curve in enumerate(curves):
            seen = arena[row.OFFSET + j] + arena[row.WEIGHT + j] * curve(time)
            rate = arena[row.RATE_OFFSET + j] + arena[row.RATE_WEIGHT + j] * curve.deriv()(time)
            np.testing.assert_allclose(seen, curve(time - late[j]), rtol=1e-13)
            np.testing.assert_allclose(rate, curve.deriv()(time - late[j]), rtol=1e-11)


def test_a_recorded_reading_enters_the_delay_line() -> None:
    state = np.zeros((LANES, 8))
    state[:, :4] = np.random.default_rng(0).normal(size=(LANES, 4)) * [1.0, 1.0, 0.1, 0.1]
    state[:, 4:] = np.random.default_rng(1).normal(size=(LANES, 4))
    y, v = np.split(ARM.internal_state(state).T, 2)
    history = np.zeros((4 * SLOTS, LANES))
    of = Variant(GAIN, 1, True, LANES)
    with plain_python(of):
        delay_line.store_reading(arena_of(of, Y=y, V=v), history, 2)
    np.testing.assert_allclose(history[8:12], state[:, [0, 1, 4, 5]].T, rtol=1e-13)
    assert not history[:8].any()
    assert not history[12:].any()


def test_the_sensor_says_where_it_was() -> None:
    """A rigid arm turning evenly: one lane has a new reading, one has none yet, one is not asked."""
    of = Variant(TORQUE, 1, True, LANES)
    header = np.zeros(word.PLACES, dtype=np.int64)
    settings = np.zeros(entries.extent(entries.Setting.layout(of.shape)))
    delay, distance, now = 2.5 * STEP, 2.0, 20
    with plain_python(of):
        settings[setting.STEP], settings[setting.PERIOD] = STEP, 5 * STEP
        settings[setting.LENGTHS : setting.LENGTHS + 2] = ARM.parameters.link_lengths
        arena = arena_of(of, SENSOR_DELAY=[delay, delay], SENSOR_POINT_DISTANCE=distance)
        arena[row.SAMPLE_TIME] = (now - 7.5) * STEP, (now - 4) * STEP, 0.0
        arena[row.LINK_SENSOR] = 9.0
        clock = np.zeros((entries.CLOCK_ROWS, LANES), dtype=np.int64)
        history = np.zeros((4 * SLOTS, LANES))
        delay_line.count_steps(clock, history, now)
        for step in range(now + 1 - SLOTS, now + 1):
            slot = 4 * (step % SLOTS)
            history[slot : slot + 4] = np.array([[3.0 * step * STEP], [1.0], [3.0], [0.0]])
        square = np.array([[[0.0, 1.0, 2.0, 0.0, 0.0], [1.0, 1.0, 2.0, 0.0, 0.0]]])
        arena[row.REFERENCE : row.REFERENCE + 2] = [[1.0], [2.0]]
        keys, active = np.zeros(LANES, dtype=np.uint64), np.array([True, True, False])
        arrays = {"arena": arena, "history": history, "clock": clock, "keys": keys, "paths": square}
        sensor.sense(block_of(**arrays, header=header, settings=settings, active=active))
        np.testing.assert_array_equal(arena[row.SAMPLE_AGE] >= 0.0, [True, False, False])
        theta1, length = 3.0 * (now * STEP - delay), ARM.parameters.link_lengths[0]
        x = length * np.cos(theta1) + distance * np.cos(theta1 + 1.0)
        np.testing.assert_allclose(arena[row.LINK_SENSOR], [x, 9.0, 9.0], rtol=1e-12)
        assert arena[row.SENSOR_ERROR, 0] == pytest.approx(1.0 - x, rel=1e-12)


def test_a_reset_request_names_what_an_episode_draws() -> None:
    """The payload and the stiffness of one lane; the others keep what they have."""
    simulator = BatchSimulator(
        settings_of(SQUARE, arm={"preset": "linear", "modes_per_link": 1, "payload_mass": 0.5}), LANES
    )
    memory = {name: part.view(simulator._memory) for name, part in simulator._parts.items()}
    request = memory["RESET_REQUESTS"][1].copy()
    request[entries.column.DRAWN + drawn.PAYLOAD_MASS], request[entries.column.DRAWN + drawn.STIFFNESS] = 0.75, 2.0
    arena = memory["ARENAS"][0]
    with plain_python(simulator._variant):
        reset.draw_quantities(arena, np.uint64(7), memory["LANE_SETTINGS"][0], request, 1)
        found = arena[row.CONSTANTS : row.CONSTANTS + variant.constants, 1]
        stiff = slice(entries.constant.STIFFNESS_1, entries.constant.DAMPING_1)
    parameters = ArmParameters.linear(modes_per_link=1, payload_mass=0.75)
    expected = np.array(FlexibleArm(parameters).constants.flat())
    expected[stiff] *= 2.0
    first, _ = simulator._rows["CONSTANTS"]
    np.testing.assert_allclose(found[: stiff.stop], expected[: stiff.stop], rtol=1e-12)
    assert not arena[first : first + len(expected), 0].any()


# --- all together -----------------------------------------------------------------------------------------------------


@pytest.mark.compiled
@pytest.mark.parametrize(
    ("env_id", "count", "options"),
    [
        (SQUARE, 8, {}),
        (
            RESIDUAL,
            1,
            {
                "arm": "linear",
                "action_mode": "reference",
                "shift_limit": (0.2, 0.1),
                "reference": ["square", "line", "circle"],
            },
        ),
        (PAPER, 1, {"compensation": "per_joint"}),
    ],
    ids=str,
)
def test_environments_run_in_plain_python_as_compiled(
    env_id: str, count: int, options: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Episodes begin, and some periods pass; recorded kernels round their sums with products twice here."""
    settings = settings_of(env_id, **options)
    compiled, plain = BatchSimulator(settings, count), BatchSimulator(settings, count)
    keys, everyone = np.arange(count, dtype=np.uint64) + 5, np.arange(count)
    compiled.start(keys, everyone, compiled.usual_requests)
    run_plainly(monkeypatch)
    plain.start(keys, everyone, plain.usual_requests)
    rng = np.random.default_rng(0)
    for k in range(4):
        np.testing.assert_allclose(plain.results, compiled.results, rtol=1e-8, atol=1e-9, err_msg=f"period {k}")
        np.testing.assert_allclose(plain.observations, compiled.observations, rtol=1e-5, atol=1e-6)
        compiled.actions[:] = plain.actions[:] = rng.uniform(-0.5, 0.5, plain.actions.shape)
        compiled.step()
        plain.step()

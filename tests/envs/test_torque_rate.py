"""The action mode in which an action changes the torques."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from gymnasium.utils import env_checker
from numpy.typing import NDArray

from flexarm_agents import FlexArmVecEnv
from flexarm_env.actions import action_from_physical, physical_from_action
from flexarm_env.codegen.declarations import plain_python
from flexarm_env.envs.batch import BatchSimulator
from flexarm_env.envs.choices import DEFAULT_OBSERVATION
from flexarm_env.envs.kernel_inputs import header_and_settings, tail_rows
from flexarm_env.envs.observation import observation_layout
from flexarm_env.envs.settings import Settings
from flexarm_env.episode import actuation
from flexarm_env.episode.period import step_blocks
from flexarm_env.kernels.entries import drawn, extent, word
from flexarm_env.kernels.layout import row
from flexarm_env.kernels.variants import Variant
from tests.support.envs import (
    FREE,
    GAIN,
    SQUARE,
    TORQUE_LIMITS,
    bare,
    block,
    exact_actions,
    make,
)
from tests.support.plain import KERNELS
from tests.support.refusals import refuses

Array = NDArray[np.float64]
RATE: dict[str, Any] = {"action_mode": "torque_rate", "observation": [*DEFAULT_OBSERVATION, "torque"]}


def summed(actions: Array, change: Array, limit: Array = TORQUE_LIMITS) -> Array:
    """Torques that the actions add up to, each within the limit. Shape (steps, 2)."""
    torques = [np.zeros(2)]
    for action in actions:
        torques.append(np.clip(torques[-1] + change * action, -limit, limit))
    return np.array(torques[1:])


@pytest.mark.parametrize("kernels", KERNELS, indirect=True)
def test_torque_rates_add_up(kernels: str) -> None:
    """Held over each period, within the motors' limits, observed; and from 0 again after a reset."""
    env = bare(start="moving", physics_step=1e-3, **RATE, **FREE)
    actions = np.clip(exact_actions(60) + 0.3125, -1.0, 1.0)
    for _ in range(2):
        observations, infos = zip(env.reset(seed=1), *(env.step(action)[::4] for action in actions), strict=True)
        states, torques = (np.array([info[name] for info in infos]) for name in ("state", "torque"))
        expected = summed(actions, np.array([30.0, 10.0]))
        assert (np.abs(expected) == TORQUE_LIMITS).any(axis=0).all()
        np.testing.assert_allclose(torques, [np.zeros(2), *expected], rtol=1e-14)
        np.testing.assert_allclose(block(env, np.array(observations), "torque"), torques, rtol=1e-6)
        run = env.arm.simulate(states[0], np.repeat(torques[1:], 10, axis=0), 0.6)
        np.testing.assert_allclose(states, run.state[::10], rtol=0.0, atol=1e-12 * np.abs(states).max())


@pytest.mark.usefixtures("uncompiled")
def test_environments_of_torque_rates_are_environments() -> None:
    """For Gymnasium and for stable-baselines3; the other environments of a batch, in plain Python, are the same."""
    made = make(**RATE, **FREE)
    env_checker.check_env(made.unwrapped, skip_render_check=True)
    adapter = FlexArmVecEnv.make("flexarm_env:" + SQUARE, 1, arm="linear", **RATE, **FREE)
    np.testing.assert_array_equal(adapter.reset().shape, (1, *made.observation_space.shape))
    adapter.close()
    env = bare(**RATE, **FREE)
    simulator = BatchSimulator(env.settings, 2)
    keys = np.arange(2, dtype=np.uint64) + 3
    simulator.request_resets(keys, np.arange(2), simulator.usual_requests)
    env.simulator.start(keys[:1], np.zeros(1, dtype=np.int64), env.simulator.usual_requests)
    simulator._header[word.DRIVING] = 0
    for action in exact_actions(4):
        with plain_python(simulator._variant), np.errstate(all="ignore"):
            results = np.empty((len(env.simulator.result(0)), simulator._arenas.shape[2]))
            step_blocks(simulator._memory, 0, 1, results)
        np.testing.assert_allclose(results[:, 0], env.simulator.result(0), rtol=1e-8, atol=1e-9)
        np.testing.assert_allclose(simulator.observations[0], env.simulator.observations[0], rtol=1e-5, atol=1e-6)
        simulator._header[word.DRIVING] = 1
        simulator.actions[:] = env.simulator.actions[:] = action
        env.simulator.step()


@pytest.mark.parametrize("delay", [0.0, 0.0003, 0.01, 0.0137])
def test_late_torque_rates_act_as_late_as_late_torques(delay: float) -> None:
    """The commanded torques, not their sum, are late: as torques that are commanded so; in plain Python."""
    options = {"torque_rate_limit": (500.0, 1e4), "torque_limit": (12.0, 40.0), "actuation_delay": delay}
    settings = Settings.of({**RATE, **options, "arm": "linear", "last_actions": 5, "physics_step": 1e-3})
    header, table = header_and_settings([settings], settings.program, observation_layout(settings, settings.program))
    variant = Variant(settings.program, 2, True, 2, sensor="true", disturbed=True)
    arena = np.zeros((extent(variant.rows) + tail_rows([settings], hosted=False), 2))
    actions, held = exact_actions(12), delay == 0.0
    torques = np.vstack([np.zeros((3, 2)), summed(actions, np.array([5.0, 100.0]), np.array([12.0, 40.0]))])
    with plain_python(variant):
        arena[row.EPISODE + drawn.ACTUATION_DELAY] = delay
        for period, action in enumerate(actions):
            arena[row.TAIL + 14 : row.TAIL + 16] = action[:, None]  # after seven previews
            actuation.add_up_torques(arena, header, table)
            for part in range(10):
                actuation.write_commands(arena, header, table, part, held)
                moments = (np.arange(100) + 0.5) / 100 * 1e-3 + part * 1e-3 - delay  # of command, by microseconds
                expected = torques[period + 3 + np.floor(moments / 0.01).astype(int)].mean(axis=0)
                np.testing.assert_allclose(arena[row.TAU : row.TAU + 2, 0], expected, rtol=1e-6, atol=1e-6)


def test_the_map_of_torque_rates_inverts() -> None:
    settings = Settings.of({"action_mode": "torque_rate", "torque_rate_limit": (10.0, 20.0)})
    rates = physical_from_action("torque_rate", [0.5, -1.0], settings.action_limit)
    np.testing.assert_array_equal(rates, [5.0, -20.0])
    np.testing.assert_array_equal(action_from_physical("torque_rate", rates, settings.action_limit), [0.5, -1.0])


def test_only_torque_rates_have_their_option_and_block() -> None:
    with refuses(ValueError, "torque_rate_limit = (1.0, 1.0): has no effect with action_mode = 'torque'; only"):
        Settings.of({"torque_rate_limit": (1.0, 1.0)})
    with refuses(
        ValueError, "observation: there is no block 'torque' with action_mode = 'gain'", "only with 'torque_rate'"
    ):
        make(GAIN, observation=["torque"])

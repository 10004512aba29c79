"""Rollouts under linear feedback: against steps one by one, in plain Python, over lanes; and their refusals."""

from typing import Any

import numpy as np

from flexarm_env import ArmParameters, FlexibleArm
from flexarm_env.codegen.declarations import plain_python
from flexarm_env.kernels.entries import extent
from flexarm_env.kernels.rk4 import FEEDBACK, run_feedback
from flexarm_env.kernels.variants import Variant
from flexarm_env.simulation.held_torque import LANES

ARM = FlexibleArm(ArmParameters.linear(modes_per_link=1))
PERIODS, SIZE = 5, 8
COUNT = LANES + 3  # a full block and one with lanes to spare
RNG = np.random.default_rng(0)
STATES = 0.3 * RNG.normal(size=(COUNT, SIZE))
TORQUES = 20.0 * RNG.normal(size=(PERIODS, 2))
FEEDBACK_OPTIONS: dict[str, Any] = {
    "gains": 40.0 * RNG.normal(size=(PERIODS, 2, SIZE)),
    "references": 0.3 * RNG.normal(size=(PERIODS, SIZE)),
    "torque_gains": 0.3 * RNG.normal(size=(PERIODS, 2, 2)),
    "torque_before": (4.0, -2.0),
    "limits": (25.0, 15.0),
}


def by_steps(state: np.ndarray, **quantities: float) -> tuple[np.ndarray, np.ndarray]:
    states, torques, limits = [state], [np.array(FEEDBACK_OPTIONS["torque_before"])], FEEDBACK_OPTIONS["limits"]
    for t in range(PERIODS):
        wanted = TORQUES[t] + FEEDBACK_OPTIONS["gains"][t] @ (states[-1] - FEEDBACK_OPTIONS["references"][t])
        wanted = wanted + FEEDBACK_OPTIONS["torque_gains"][t] @ torques[-1]
        torques.append(np.clip(wanted, -np.array(limits), limits))
        states.append(ARM.step(states[-1], torques[-1], **quantities))
    return np.array(states), np.array(torques[1:])


def test_it_is_step_by_step_with_the_formula() -> None:
    masses = np.linspace(0.0, 0.5, COUNT)
    run = ARM.rollout(STATES, TORQUES, **FEEDBACK_OPTIONS, payload_mass=masses)
    assert run.states.shape == (COUNT, PERIODS + 1, SIZE)
    assert run.torques.shape == (COUNT, PERIODS, 2)
    assert np.any(np.abs(run.torques) == FEEDBACK_OPTIONS["limits"])
    for n in (0, LANES + 1):
        states, torques = by_steps(STATES[n], payload_mass=masses[n])
        np.testing.assert_allclose(run.states[n], states, rtol=0.0, atol=1e-9)
        np.testing.assert_allclose(run.torques[n], torques, rtol=0.0, atol=1e-7)


def test_the_drivers_give_it_in_plain_python() -> None:
    """The recorded kernel rounds its sums with products twice."""
    lanes, count = 2, 3
    variant = Variant(FEEDBACK, 1, True, lanes)
    states, torques = np.zeros((count, 2, SIZE)), np.zeros((count, 2, 2))
    states[:, 0], torques[:, 0] = STATES[:count], FEEDBACK_OPTIONS["torque_before"]
    tables = [FEEDBACK_OPTIONS[name][None, :1] for name in ("gains", "references", "torque_gains")]
    limits = np.array(FEEDBACK_OPTIONS["limits"])
    with plain_python(variant):
        arena = np.zeros((extent(variant.rows), lanes))
        run_feedback(arena, ARM._own[0], TORQUES[None, :1], *tables, limits, 1e-3, 10, states, torques)
    short = {name: value[:1] if np.ndim(value) > 1 else value for name, value in FEEDBACK_OPTIONS.items()}
    run = ARM.rollout(STATES[:count], TORQUES[:1], **short)
    np.testing.assert_allclose(run.states, states, rtol=1e-12)
    np.testing.assert_allclose(run.torques, torques[:, 1:], rtol=1e-12)


def test_tables_are_shared_or_each_arm_has_its_own() -> None:
    shared = ARM.rollout(STATES, TORQUES, **FEEDBACK_OPTIONS)
    each = {name: value for name, value in FEEDBACK_OPTIONS.items() if name != "limits"}
    each = {name: np.broadcast_to(value, (COUNT, *np.shape(value))) for name, value in each.items()}
    own = ARM.rollout(STATES, np.broadcast_to(TORQUES, (COUNT, PERIODS, 2)), **each, limits=FEEDBACK_OPTIONS["limits"])
    for one, other in zip(shared, own, strict=True):
        np.testing.assert_array_equal(one, other)
    many = ARM.rollout(STATES[0], np.array([TORQUES, -TORQUES]))
    assert many.states.shape == (2, PERIODS + 1, SIZE)
    np.testing.assert_array_equal(many.states[1], ARM.rollout(STATES[0], -TORQUES).states)


def test_an_arm_that_flies_off_leaves_the_others_alone() -> None:
    run = ARM.rollout(STATES[:2], np.array([TORQUES, np.full_like(TORQUES, 1e12)]))
    np.testing.assert_array_equal(run.states[0], ARM.rollout(STATES[0], TORQUES).states)
    assert np.abs(run.states[1]).max() > 1e6

"""Any options at all: taken, and then the environment runs; or refused by name, soon, and with no warning."""

import math
from collections.abc import Callable
from dataclasses import fields
from functools import partial
from typing import Any

import numpy as np
import pytest
from hypothesis import event, example, given, reject
from hypothesis import strategies as st

from flexarm_env import ArmParameters, FlexibleArm, LawParameters, SensorParameters, SquareParameters
from flexarm_env.envs.single import FlexArmEnv
from flexarm_env.physics.paths import ReferencePath, inverse_kinematics, square, way_points
from tests.envs.test_contract import POLICIES, play
from tests.hardening.strategies import GARBAGE, NAMES, SETTINGS_FIELDS, any_options, cases, check_refusal, declared_arms
from tests.support.envs import make
from tests.support.plain import run_plainly

# A modal coordinate of 1e12 turns link 1's tip by 1e17 rad, where the kernels' sine is beyond all bounds.
STEEP = {"kinematics": "foreshortened", "mode_shapes": "polynomial", "modes_per_link": 3}
STEEP |= {"mode_scale": 100.0, "link_lengths": (0.001, 4.5)}


@cases(60, 100_000)
@given(any_options())
def test_options_are_taken_or_refused_by_name(options: dict[str, Any]) -> None:
    """For the environments that are made nothing is compiled."""
    try:
        FlexArmEnv(**options)
        event("made")
    except Exception as error:
        check_refusal(error, options)
        event("refused")


@cases(15, 1_000)
@given(any_options(garbage=False), st.sampled_from(POLICIES), st.integers(0, 2**32 - 1))
def test_what_is_taken_runs(options: dict[str, Any], policy: str, seed: int) -> None:
    """Within the bounds, in plain Python; `tests/envs/test_contract.py` has a case for each option."""
    with pytest.MonkeyPatch.context() as patch:
        run_plainly(patch)
        try:
            env: Any = make(max_episode_steps=8, **options)
        except (ValueError, UserWarning):  # options that do not go together, or a coarse step
            reject()
        affordable = 200 // env.unwrapped.settings.substeps  # periods; an integration step takes milliseconds
        play(env, policy, min(max(affordable, 2), 10), seed)


@cases(60, 20_000)
@given(declared_arms(), st.integers(0, 2**32 - 1))
@example({"elbow_mass": 10.0, "kinematics": "foreshortened", "mode_scale": 1e6}, 0)  # the inertia was singular
@example({"elbow_mass": 10.0, "kinematics": "foreshortened", "mode_scale": 1e3}, 0)
@example(STEEP, 0)  # linearised, the inertia was singular
def test_arms_compute_finite_numbers(parameters: dict[str, Any], seed: int) -> None:
    """All that an arm computes is finite, at ordinary states and at the largest that are accepted."""
    try:
        arm = FlexibleArm(ArmParameters.linear(**parameters))
    except (TypeError, ValueError) as error:
        check_refusal(error, parameters)
        return
    rng = np.random.default_rng(seed)
    n, (length_1, length_2) = arm.size, arm.parameters.link_lengths
    assert 0.0 < arm.fastest_rate() < math.inf
    for state in (np.zeros(2 * n), rng.normal(size=2 * n), np.full(2 * n, 1e12), -(10.0 ** rng.uniform(-9, 12, 2 * n))):
        q = state[:n]
        found = [
            *(arm.acceleration(state, (1e3, -1e3)), *arm.energy(state), arm.angular_momentum(state)),
            *(arm.velocity(state, 2, length_2), arm.point_jacobian(q, 1, length_1), arm.mass_matrix(q)),
            *(arm.tip(q), arm.rigid_tip(q), arm.tip_deflection(q), arm.velocity_forces(q, state[n:])),
            *(arm.linearise(state).A, arm.internal_state(state), arm.public_state(state)),
        ]
        assert all(np.isfinite(array).all() for array in found)


ARM = FlexibleArm(ArmParameters.linear())
ZEROS = np.zeros((2, ARM.size))
RUN: dict[str, Any] = {"time": np.zeros(2), "state": np.zeros((2, 2 * ARM.size)), "torque": np.zeros((2, 2))}
CALLS: dict[str, Callable[[Any], Any]] = {
    "point": lambda value: inverse_kinematics(ARM.parameters, value, "positive"),
    "elbow_branch": lambda value: inverse_kinematics(ARM.parameters, (1.0, 2.0), value),
    "table": ReferencePath,
    "waypoints": lambda value: way_points(SquareParameters(), value),
    "time": square(SquareParameters()).position,
    "shoulder_to_elbow": SensorParameters().joint_delays,
    "parameters": FlexibleArm,
    "q": ARM.tip,
    "state": ARM.energy,
    "s": lambda value: ARM.position(ZEROS[0], 1, value),
    "link": lambda value: ARM.position(ZEROS[0], value, 1.0),
    "torque": lambda value: ARM.acceleration(ZEROS.ravel(), value),
    "gain": lambda value: ARM.record(**RUN, gain=value),
    "notes": lambda value: ARM.record(**RUN, notes=value),
    "time of a run": lambda value: ARM.record(**(RUN | {"time": value})),
    "state of a run": lambda value: ARM.record(**(RUN | {"state": value})),
    "torque of a run": lambda value: ARM.record(**(RUN | {"torque": value})),
}
for kind in (ArmParameters, SensorParameters, LawParameters, SquareParameters):
    for one in fields(kind):
        made_of = lambda value, kind=kind, name=one.name: kind(**{name: value})  # noqa: E731
        CALLS[f"{one.metadata['name'] or one.name} of {kind.__name__}"] = made_of
CALLS |= {f"{name} of an environment": partial(SETTINGS_FIELDS[name].check, name) for name in NAMES}


@pytest.mark.parametrize("name", CALLS)
def test_garbage_is_refused_by_name(name: str) -> None:
    for value in GARBAGE:
        for given_value in (value, [value] * 2, [value] * 12):
            try:
                CALLS[name](given_value)
            except Exception as error:
                check_refusal(error, [name.partition(" ")[0], "state"])

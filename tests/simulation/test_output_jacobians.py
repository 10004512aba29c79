"""Derivatives of what sensors read and of the tips."""

from typing import Any

import numpy as np
import pytest

from flexarm_env import FlexibleArm
from flexarm_env.codegen.declarations import plain_python
from flexarm_env.codegen.tangents import jacobian
from flexarm_env.kernels.entries import extent
from flexarm_env.kernels.layout import arm_rows, place_rows
from flexarm_env.kernels.output_jacobians import OUTPUT_JACOBIANS, run_outputs
from flexarm_env.kernels.variants import Variant
from flexarm_env.physics import sensing
from flexarm_env.physics.dynamics import internal_coordinates
from tests.support.lagrange import loaded_arm, random_state

POSITION = 2.5


@pytest.fixture(scope="module", params=[(2, "linear"), (3, "foreshortened")], ids=str)
def arm(request: pytest.FixtureRequest) -> FlexibleArm:
    modes, kinematics = request.param
    return FlexibleArm(loaded_arm(modes, kinematics=kinematics))


def test_outputs_are_the_arms(arm: FlexibleArm) -> None:
    states = np.array([random_state(arm.parameters, seed) for seed in range(6)]).reshape(2, 3, -1)
    q, n = states[..., : arm.size], arm.size
    found, _ = arm.output_jacobians(states, POSITION)
    close: dict[str, Any] = {"rtol": 1e-12, "atol": 1e-13}
    np.testing.assert_allclose(found.joints, states[..., [0, 1, n, n + 1]], **close)
    np.testing.assert_allclose(found.sensed[..., :2], arm.position(q, 2, POSITION), **close)
    np.testing.assert_allclose(found.sensed[..., 2:], arm.velocity(states, 2, POSITION), **close)
    np.testing.assert_allclose(found.true_tip, arm.tip(q), **close)
    np.testing.assert_allclose(found.rigid_tip, arm.rigid_tip(q), **close)
    np.testing.assert_allclose(found.deflection, arm.tip_deflection(q), **close)
    np.testing.assert_allclose(found.deflection_rate, arm.tip_deflection(states[..., n:]), **close)


def test_their_derivatives_are_limits_of_differences(arm: FlexibleArm) -> None:
    state, h = random_state(arm.parameters, 3), 1e-6
    _, found = arm.output_jacobians(state, POSITION)
    for n, direction in enumerate(np.eye(len(state))):
        ends, _ = arm.output_jacobians(state + h * direction * np.array([[1.0], [-1.0]]), POSITION)
        for name, values in ends._asdict().items():
            expected = (values[0] - values[1]) / (2.0 * h)
            np.testing.assert_allclose(getattr(found, name)[:, n], expected, rtol=1e-7, atol=1e-7, err_msg=name)


@pytest.mark.parametrize("kinematics", ["linear", "foreshortened"])
def test_the_driver_gives_the_formulas_on_dual_numbers_in_plain_python(kinematics: str) -> None:
    """Nothing is compiled; more states than lanes."""
    arm = FlexibleArm(loaded_arm(1, kinematics=kinematics))
    k, points = arm.constants, {"TIP": arm.place(2, 3.7), "SENSOR_POINT": arm.place(2, POSITION)}
    states = np.array([random_state(arm.parameters, seed) for seed in range(3)])

    def outputs(x: Any) -> list[Any]:
        y, v = (internal_coordinates(k, half) for half in (x[:4], x[4:]))
        return [number for part in sensing.outputs(k, *points.values(), y, v) for number in part]

    variant = Variant(OUTPUT_JACOBIANS, 1, True, 2, foreshortened=k.foreshortened)
    values, slopes = np.empty((3, 16)), np.empty((3, 16, 8))
    with plain_python(variant):
        arena = np.zeros((extent(variant.rows), 2))
        known = [arm_rows(k), *(place_rows(name, point) for name, point in points.items())]
        for name, numbers in (item for part in known for item in part.items()):
            first, count = variant.rows[name]
            arena[first : first + count] = np.reshape(numbers, (count, 1))
        run_outputs(arena, states, values, slopes)
    for found, expected in zip((values, slopes), jacobian(outputs, states), strict=True):
        np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-13)

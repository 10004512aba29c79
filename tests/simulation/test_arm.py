"""`FlexibleArm`: what it promises to a user (its physics: test_dynamics, test_orders, test_drift)."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from flexarm_env import ArmParameters, DivergenceError, FlexibleArm, Trajectory
from tests.support.lagrange import loaded_arm, random_state

REST = np.zeros(12)  # the default arm's


@pytest.fixture(scope="module", params=[(1, "linear"), (2, "linear"), (2, "foreshortened")], ids=str)
def arm(request: pytest.FixtureRequest) -> FlexibleArm:
    modes, kinematics = request.param
    return FlexibleArm(loaded_arm(modes, kinematics=kinematics))


@pytest.fixture(scope="module")
def default() -> FlexibleArm:
    return FlexibleArm(ArmParameters.linear())


def states(arm: FlexibleArm, *shape: int) -> np.ndarray:
    count = int(np.prod(shape))
    return np.array([random_state(arm.parameters, seed) for seed in range(count)]).reshape(*shape, 2 * arm.size)


FUNCTIONS: dict[str, Callable[[FlexibleArm, np.ndarray], Any]] = {
    "mass_matrix": lambda arm, state: arm.mass_matrix(state[..., : arm.size]),
    "velocity_forces": lambda arm, state: arm.velocity_forces(*np.split(state, 2, axis=-1)),
    "acceleration": lambda arm, state: arm.acceleration(state, (3.0, -1.0)),
    "kinetic energy": lambda arm, state: arm.energy(state).kinetic,
    "strain energy": lambda arm, state: arm.energy(state).strain,
    "angular_momentum": lambda arm, state: arm.angular_momentum(state),
    "position 1": lambda arm, state: arm.position(state[..., : arm.size], 1, 2.0),
    "position 2": lambda arm, state: arm.position(state[..., : arm.size], 2, 2.0),
    "velocity": lambda arm, state: arm.velocity(state, 2, 2.0),
    "point_jacobian": lambda arm, state: arm.point_jacobian(state[..., : arm.size], 2, 2.0),
    "elbow": lambda arm, state: arm.elbow(state[..., : arm.size]),
    "tip": lambda arm, state: arm.tip(state[..., : arm.size]),
    "rigid_tip": lambda arm, state: arm.rigid_tip(state[..., : arm.size]),
    "tip_deflection": lambda arm, state: arm.tip_deflection(state[..., : arm.size]),
}


@pytest.mark.parametrize("name", FUNCTIONS)
def test_leading_axes_are_a_loop(arm: FlexibleArm, name: str) -> None:
    batch = states(arm, 2, 3)
    together = FUNCTIONS[name](arm, batch)
    n = arm.size
    inner = {"mass_matrix": (n, n), "velocity_forces": (n,), "acceleration": (n,), "point_jacobian": (2, n)}
    inner |= {"kinetic energy": (), "strain energy": (), "angular_momentum": ()}
    assert together.shape == (2, 3, *inner.get(name, (2,)))
    alone = np.array([[FUNCTIONS[name](arm, batch[i, j]) for j in range(3)] for i in range(2)])
    # numpy's sine of an array may differ by an ulp from that of a number, and sums may be taken in another order
    np.testing.assert_allclose(together, alone, rtol=1e-12, atol=1e-12 * np.abs(alone).max())


def test_broadcasting_of_second_arguments(arm: FlexibleArm) -> None:
    batch = states(arm, 4)
    q, rates = np.split(batch, 2, axis=-1)
    assert arm.velocity_forces(q[:, None], rates).shape == (4, 4, arm.size)
    torques = np.arange(6.0).reshape(3, 1, 2)
    accelerations = arm.acceleration(batch, torques)
    assert accelerations.shape == (3, 4, arm.size)
    np.testing.assert_allclose(accelerations[2, 1], arm.acceleration(batch[1], torques[2, 0]), rtol=1e-11)
    s = np.linspace(0.0, 3.0, 5)
    for link in (1, 2):
        points, velocities = arm.position(q, link, s[:, None]), arm.velocity(batch, link, s[:, None])
        assert points.shape == velocities.shape == (5, 4, 2)
        assert arm.point_jacobian(q, link, s[:, None]).shape == (5, 4, 2, arm.size)
        assert arm.position(q[0], link, s).shape == (5, 2)
        # sums of a few metres
        np.testing.assert_allclose(points[3, 2], arm.position(q[2], link, s[3]), atol=1e-14)
        np.testing.assert_allclose(velocities[3, 2], arm.velocity(batch[2], link, s[3]), rtol=1e-12)


def test_results_are_new_and_arguments_stay_as_they_were(arm: FlexibleArm) -> None:
    state = states(arm, 3)
    before = state.copy()
    for function in FUNCTIONS.values():
        function(arm, state)[...] = np.nan
    np.testing.assert_array_equal(state, before)
    lists = state[0].tolist()
    np.testing.assert_array_equal(arm.acceleration(lists), arm.acceleration(state[0]))


@pytest.mark.parametrize(("link", "s"), [(1, 0.0), (1, 1.9), (1, 4.5), (2, 0.0), (2, 1.1), (2, 3.7)])
def test_velocity_and_jacobian_are_derivatives_of_position(arm: FlexibleArm, link: int, s: float) -> None:
    state = states(arm)
    q, rates = np.split(state, 2)
    h = 1e-5  # truncation h^2/6 of the third derivative, some 1e3 m/s^3; rounding 1e-15 / h
    difference = (arm.position(q + h * rates, link, s) - arm.position(q - h * rates, link, s)) / (2.0 * h)
    np.testing.assert_allclose(arm.velocity(state, link, s), difference, atol=1e-6)
    jacobian = arm.point_jacobian(q, link, s)
    np.testing.assert_allclose(jacobian @ rates, arm.velocity(state, link, s), rtol=1e-12, atol=1e-12)
    for i, direction in enumerate(np.eye(arm.size)):
        difference = (arm.position(q + h * direction, link, s) - arm.position(q - h * direction, link, s)) / (2.0 * h)
        np.testing.assert_allclose(jacobian[:, i], difference, atol=1e-8)  # metres per unit coordinate


def test_rigid_tip_is_the_undeflected_one(arm: FlexibleArm) -> None:
    q = states(arm)[: arm.size]
    straight = np.zeros(arm.size)
    straight[:2] = q[:2]
    np.testing.assert_allclose(arm.rigid_tip(q), arm.tip(straight), atol=1e-14)
    straight[:2] = np.pi / 2, -np.pi / 2
    np.testing.assert_allclose(arm.rigid_tip(straight), [3.7, 4.5], atol=1e-14)


def test_internal_and_public_states_are_inverses(arm: FlexibleArm) -> None:
    batch = states(arm, 5)
    internal = arm.internal_state(batch)
    assert internal.shape == batch.shape
    np.testing.assert_allclose(arm.public_state(internal), batch, atol=1e-14 * np.abs(batch).max())
    for one, row in zip(arm.public_state(internal), internal, strict=True):
        np.testing.assert_array_equal(arm.public_state(row), one)  # the same bits alone and in a batch


@pytest.mark.parametrize("kind", ["none", "array", "function"])
def test_a_run_has_what_is_promised(arm: FlexibleArm, kind: str) -> None:
    torque: Any = {"none": None, "array": np.ones((7, 2)), "function": lambda time, state: (time, -1.0)}[kind]
    start = random_state(arm.parameters, 4, deflection=0.1, rate=0.5)
    run = arm.simulate(start, torque, duration=0.07, step=0.01, substeps="auto")
    assert (type(run), run.parameters, len(run)) == (Trajectory, arm.parameters, 8)
    shapes = {"time": (8,), "state": (8, 2 * arm.size), "kinetic_energy": (8,), "strain_energy": (8,)}
    shapes |= dict.fromkeys(("tip", "elbow", "rigid_tip", "tip_deflection", "torque"), (8, 2))
    assert {name: array.shape for name, array in run.arrays().items()} == shapes
    assert all(array.dtype == np.float64 for array in run.arrays().values())
    np.testing.assert_array_equal(run.time, 0.01 * np.arange(8))
    np.testing.assert_array_equal(run.state[0], start)
    q = run.state[:, : arm.size]
    for name in ("tip", "elbow", "rigid_tip", "tip_deflection"):
        np.testing.assert_array_equal(getattr(run, name), getattr(arm, name)(q))
    np.testing.assert_array_equal(run.kinetic_energy, arm.energy(run.state).kinetic)
    np.testing.assert_array_equal(run.strain_energy, arm.energy(run.state).strain)
    expected = {"none": np.zeros((8, 2)), "array": np.ones((8, 2)), "function": np.stack([run.time, -np.ones(8)], 1)}
    np.testing.assert_allclose(run.torque, expected[kind], rtol=1e-15)
    assert run.reference is run.sensed is run.gain is run.reward is None


def test_held_torques_act_just_after_their_instant(default: FlexibleArm) -> None:
    torques = np.array([[0.0, 0.0], [5.0, -2.0], [0.0, 0.0]])
    run = default.simulate(REST, torques, 0.003, step=1e-3)
    np.testing.assert_array_equal(run.state[:2], 0.0)
    assert np.any(run.state[2] != 0.0)
    np.testing.assert_array_equal(run.torque, [*torques, torques[-1]])


def test_runs_are_repeatable_and_share_nothing(default: FlexibleArm) -> None:
    start, torques = np.full(12, 0.01), np.ones((20, 2))
    first = default.simulate(start, torques, 0.02)
    start[:] = torques[:] = 7.0
    second = default.simulate(np.full(12, 0.01), np.ones((20, 2)), 0.02)
    np.testing.assert_array_equal(first.state, second.state)


def test_a_torque_function_cannot_change_the_run_through_its_argument(default: FlexibleArm) -> None:
    def vandal(time: float, state: np.ndarray) -> tuple[float, float]:
        torque = 2.0 - state[0], -1.0
        state[:] = np.nan
        return torque

    honest = default.simulate(REST, lambda time, state: (2.0 - state[0], -1.0), 0.02)
    np.testing.assert_array_equal(default.simulate(REST, vandal, 0.02).state, honest.state)


@pytest.mark.parametrize("as_function", [False, True])
@pytest.mark.parametrize("substeps", [1, 3])
@pytest.mark.parametrize("torque", [1e155, 1e305])  # an overflow within some steps; within one
def test_divergence_stops_with_time_and_the_run_until_then(
    default: FlexibleArm, as_function: bool, substeps: int, torque: float
) -> None:
    held = np.zeros((50, 2))
    held[10:] = torque
    applied = (lambda time, state: held[min(int(time / 1e-3 + 1e-9), 49)]) if as_function else held
    with pytest.raises(DivergenceError, match=r"stopped being finite after t = 0\.01") as caught:
        default.simulate(np.full(12, 0.01), applied, 0.05, step=1e-3, substeps=substeps)
    run = caught.value.trajectory
    assert 11 <= len(run) < 50
    assert caught.value.time == run.time[-1] == pytest.approx(1e-3 * (len(run) - 1))
    assert np.all(np.isfinite(run.state))
    assert {len(array) for array in run.arrays().values()} == {len(run)}
    np.testing.assert_array_equal(run.torque[10], held[10])
    # before it went wrong, all was well (a function of time acts already in the last stage before the torque's onset)
    calm = default.simulate(np.full(12, 0.01), None, 0.01, step=1e-3, substeps=substeps)
    kept = 10 if as_function else 11
    # a function's stages are put together in Python, which rounds products that the kernel fuses with sums
    np.testing.assert_allclose(run.state[:kept], calm.state[:kept], rtol=1e-12 if as_function else 0.0)


def test_whole_numbers_of_steps_survive_rounding(default: FlexibleArm) -> None:
    for duration in (0.3, 0.1 + 0.2):  # 0.3 / 0.1 is 2.9999999999999996, and 0.1 + 0.2 is above 0.3
        assert len(default.simulate(REST, None, duration, step=0.1, substeps="auto")) == 4

"""The linear arm's system of equations, solved with its modal coordinates eliminated."""

import mpmath
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from flexarm_env import ArmParameters, FlexibleArm
from flexarm_env.parameters import HEAVIEST_PAYLOAD
from flexarm_env.physics import dynamics as dyn
from flexarm_env.physics import linear_algebra, modal_elimination
from tests.support.lagrange import loaded_arm

EPS = np.finfo(float).eps


@given(
    modes=st.integers(1, 4),
    shapes=st.sampled_from(["cantilever", "polynomial"]),
    payload=st.floats(0.0, 20.0) | st.floats(20.0, HEAVIEST_PAYLOAD),
    tip=st.floats(0.0, 5.0),
    hubs=st.floats(0.0, 5.0),
    seed=st.integers(0, 1000),
)
@settings(max_examples=80)
def test_elimination_solves_the_mass_matrix(
    modes: int, shapes: str, payload: float, tip: float, hubs: float, seed: int
) -> None:
    """Any arm, any posture, links bent by up to half their length, any right-hand side.

    A solution is good to the rounding of the matrix times its condition, after scaling to a unit diagonal, which takes
    away what units of the coordinates do to it; and times the payload over the 1.5 kg of a link, since the elimination
    subtracts what the payload adds.
    """
    loads = {"payload_mass": payload, "payload_inertia": tip, "elbow_hub_inertia": hubs, "shoulder_hub_inertia": hubs}
    k = FlexibleArm(ArmParameters.linear(modes_per_link=modes, mode_shapes=shapes, **loads)).constants  # type: ignore[arg-type]
    e = modal_elimination.elimination(k)
    assert e is not None
    rng = np.random.default_rng(seed)
    y, right = rng.uniform(-1.0, 1.0, (2, 2 * modes + 2))
    y[[0, modes + 1]] *= np.pi
    cos, sin = np.cos(y[modes + 1] - y[0]), np.sin(y[modes + 1] - y[0])
    matrix = np.array(dyn.mass_matrix(k, y, cos, sin))
    x = np.array(modal_elimination.solve(k, e, modal_elimination.inertia(k, e, y, cos, sin), right))
    scale = 1.0 / np.sqrt(np.diag(matrix))
    scaled = matrix * np.outer(scale, scale)
    exact = np.linalg.solve(scaled, right * scale)
    rounding = EPS * np.linalg.cond(scaled) * np.abs(exact).max()
    np.testing.assert_allclose(x / scale, exact, atol=(100 + payload / 1.5) * rounding)


@pytest.mark.parametrize(("modes", "payload", "worst"), [(2, 0.0, 1e-12), (2, 20.0, 1e-10), (4, 1000.0, 5e-6)])
def test_digits_that_a_heavy_payload_costs(modes: int, payload: float, worst: float) -> None:
    """Against a factorisation with 60 digits; the figures of the module's docstring."""
    k = FlexibleArm(ArmParameters.linear(modes_per_link=modes, payload_mass=payload)).constants
    e, size = modal_elimination.elimination(k), 2 * modes + 2
    assert e is not None
    rng, errors = np.random.default_rng(0), []
    for _ in range(8):
        y, right = rng.uniform(-1.0, 1.0, (2, size)).tolist()
        cos, sin = float(np.cos(y[modes + 1] - y[0])), float(np.sin(y[modes + 1] - y[0]))
        x = np.array(modal_elimination.solve(k, e, modal_elimination.inertia(k, e, y, cos, sin), right))
        with mpmath.workdps(60):
            precise = type(k).unflat([mpmath.mpf(number) for number in k.flat()], modes)
            matrix = dyn.mass_matrix(precise, [mpmath.mpf(each) for each in y], mpmath.mpf(cos), mpmath.mpf(sin))
            factors = linear_algebra.factor(matrix)
            exact = np.array(linear_algebra.solve(factors, [mpmath.mpf(each) for each in right]), dtype=float)
        errors.append(np.abs(x - exact).max() / np.abs(exact).max())
    assert max(errors) < worst, errors


def test_foreshortened_arms_have_none() -> None:
    """Their modal masses vary with the bend."""
    assert modal_elimination.elimination(FlexibleArm(loaded_arm(2, kinematics="foreshortened")).constants) is None

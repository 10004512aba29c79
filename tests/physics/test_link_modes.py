"""Clamped-free modes against the textbook: roots, frequencies, boundary conditions, integrals, statics."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from flexarm_env.physics.link_modes import LinkModes, link_modes
from tests.support.lagrange import clenshaw_curtis, loaded_arm, shapes, textbook_roots

L, EI, RHO, A = 4.5, 1676.0, 0.335, 0.1  # the paper's link
EPS = np.finfo(float).eps

# Shapes of mode i subtract numbers of the size of cosh(lambda_i L), and every quantity below inherits that rounding
# error: 1.5e4 ulp for the fourth mode, about 4e-12.
ROUNDING = 2.0 * np.cosh(textbook_roots(4)[-1]) * EPS


@pytest.fixture(scope="module")
def link() -> LinkModes:
    return link_modes(L, EI, RHO, 4, A)


@given(
    length=st.floats(0.1, 20.0),
    rigidity=st.floats(1.0, 1e6),
    density=st.floats(0.01, 100.0),
    scale=st.floats(0.01, 10.0),
)
def test_frequencies_scale_as_the_beam_equation_says(
    length: float, rigidity: float, density: float, scale: float
) -> None:
    modes = link_modes(length, rigidity, density, 3, scale)
    expected = np.array(textbook_roots(3)) ** 2 * np.sqrt(rigidity / (density * length**4))
    np.testing.assert_allclose(modes.frequencies, expected, rtol=20 * EPS)  # a dozen roundings
    # Rayleigh's quotient: stiffness and mass belong to the same motion
    np.testing.assert_allclose(np.sqrt(modes.stiffness / np.diag(modes.mass)), expected, rtol=ROUNDING)


@pytest.mark.parametrize(("count", "kind"), [(4, "cantilever"), *((count, "polynomial") for count in (1, 2, 3, 4))])
def test_shapes_are_the_textbooks_or_the_ritz_modes_of_monomials(count: int, kind: Any) -> None:
    link = link_modes(L, EI, RHO, count, A, kind)
    p = loaded_arm(count, mode_scale=A, mode_shapes=kind)
    x = np.linspace(0.0, L, 50)
    for order, ours in enumerate((link.shape(x), link.slope(x), link.curvature(x))):
        theirs = shapes(p, L, x, order)
        np.testing.assert_allclose(ours, theirs, atol=ROUNDING * np.abs(theirs).max())


def test_integrals_agree_with_another_rule_and_the_textbooks_shapes(link: LinkModes) -> None:
    x, weight = clenshaw_curtis(L)
    phi, bend = (shapes(loaded_arm(4, mode_scale=A), L, x, order) for order in (0, 2))
    mass = RHO * A**2 * L
    np.testing.assert_allclose(link.mass, RHO * phi.T @ (weight[:, None] * phi), atol=ROUNDING * mass)
    np.testing.assert_allclose(link.first_moment, RHO * weight @ phi, rtol=10 * ROUNDING)
    np.testing.assert_allclose(link.second_moment, RHO * (weight * x) @ phi, rtol=10 * ROUNDING)
    np.testing.assert_allclose(link.stiffness, EI * weight @ bend**2, rtol=ROUNDING)


def test_two_polynomials_hold_every_static_shape_of_forces_at_the_tip() -> None:
    """A tip force and a tip moment bend the beam by x^2 (3 L - x) and by x^2: its statics are exact."""
    link = link_modes(L, EI, RHO, 2, A, "polynomial")
    compliance = np.array([[L**3 / 3.0, L**2 / 2.0], [L**2 / 2.0, L]]) / EI
    ends = np.stack([link.tip_values, link.tip_slopes])
    np.testing.assert_allclose(ends @ (ends / link.stiffness).T, compliance, rtol=1e-12)


@pytest.mark.parametrize(("count", "missing"), [(1, 0.029), (2, 0.0047), (3, 0.0015), (4, 0.0006)])
def test_static_tip_deflection_lacks_the_modes_that_are_left_out(count: int, missing: float) -> None:
    """A tip force F deflects a clamped beam by F L^3 / (3 EI); the modes give sum phi_i(L)^2 F / k_i."""
    link = link_modes(L, EI, RHO, count, A)
    flexibility = np.sum(link.tip_values**2 / link.stiffness)
    error = 1.0 - flexibility / (L**3 / (3.0 * EI))
    # each mode adds its 12 / z_i^4 of the whole, so that the error is known; the rounded figure is the one told
    assert error == pytest.approx(1.0 - sum(12.0 / z**4 for z in textbook_roots(count)), abs=ROUNDING)
    assert error == pytest.approx(missing, rel=0.1)

"""Clamped-free modes against the textbook: roots, frequencies, shapes (integrals: test_dynamics)."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from flexarm_env.physics.link_modes import LinkModes, clamped_free_roots, link_modes
from tests.support.lagrange import loaded_arm, shapes, textbook_roots

L, EI, RHO, A = 4.5, 1676.0, 0.335, 0.1  # the paper's link
EPS = np.finfo(float).eps

# Shapes of mode i subtract numbers of the size of cosh(lambda_i L), and every quantity below inherits that rounding
# error: 1.5e4 ulp for the fourth mode, about 4e-12.
ROUNDING = 2.0 * np.cosh(textbook_roots(4)[-1]) * EPS


@pytest.fixture(scope="module")
def link() -> LinkModes:
    return link_modes(L, EI, RHO, 4, A)


def test_roots_solve_the_characteristic_equation() -> None:
    # brentq is asked for 4 ulp, its smallest tolerance
    np.testing.assert_allclose(clamped_free_roots(4), textbook_roots(4), rtol=4 * EPS)


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


def test_shape_broadcasts(link: LinkModes) -> None:
    x = np.linspace(0.0, L, 6).reshape(2, 3)
    assert link.shape(1.0).shape == (4,)
    assert link.shape(x).shape == (2, 3, 4)
    np.testing.assert_array_equal(link.slope(x)[1, 2], link.slope(x[1, 2]))

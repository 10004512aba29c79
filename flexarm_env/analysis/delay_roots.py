"""Rightmost roots of the delayed loop by a Chebyshev discretisation of its history.

The delayed loop is a transport of its past: ``u_t = u_x`` on [-T, 0] with the differential equation as the boundary
condition at 0. On Chebyshev nodes that is a matrix whose eigenvalues converge to the loop's roots faster than any
power of the number of nodes, those of smallest magnitude first. It is independent of `crossings`, and it shows how fast
an unstable loop grows.

Source: Breda, Maset & Vermiglio, *Pseudospectral differencing methods for characteristic roots of delay differential
equations*, SIAM J. Sci. Comput. 27 (2005); Trefethen, *Spectral methods in MATLAB* (2000), ch. 6.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import BarycentricInterpolator

from flexarm_env.analysis.law_loop import LawLoop
from flexarm_env.validation import instance, integer

Complex = NDArray[np.complex128]


@dataclass(frozen=True, eq=False)
class DelayRoots:
    """Approximate roots of a loop with its delay.

    Attributes:
        values: [rad/s], rightmost first. Shape ((4 + 4 m) (nodes + 1),), or (4 + 4 m,) for a loop without delay, whose
            roots are its poles.
    """

    values: Complex

    @property
    def rightmost(self) -> complex:
        """[rad/s]; the loop is stable if its real part, the rate of growth, is negative."""
        return complex(self.values[0])


def delay_roots(loop: LawLoop, nodes: int = 40) -> DelayRoots:
    """Approximate the roots of the loop with its delay.

    Args:
        loop: the loop.
        nodes: number of nodes of the history; it resolves a root s if ``|s|`` times the longer delay is well below it.
    """
    instance("loop", loop, LawLoop)
    integer("nodes", nodes, 2)
    if loop.delay == 0.0:
        return DelayRoots(_rightmost(loop.undelayed_poles()))
    linear = loop.point.linearisation
    actions = [-loop.gain * linear.B @ np.hstack([term.P, term.V]) for term in loop.terms]
    # Values on Chebyshev nodes of [-1, 1], the present at 1; the weights are those of barycentric interpolation.
    weights = (-1.0) ** np.arange(nodes + 1)
    weights[[0, -1]] *= 0.5
    x = np.cos(np.pi * np.arange(nodes + 1) / nodes)
    history = BarycentricInterpolator(x, np.eye(nodes + 1), wi=weights)
    size, longest = len(linear.A), max(1.0, loop.ratio)
    late = history(1.0 - 2.0 / longest * np.array([0.0, 1.0, loop.ratio]))
    matrix = np.kron(history.derivative(x) * (2.0 / (longest * loop.delay)), np.eye(size))
    matrix[:size] = np.kron(late[:1], linear.A)
    for action, row in zip(actions, late, strict=True):
        matrix[:size] += np.kron(row, action)
    return DelayRoots(_rightmost(np.linalg.eigvals(matrix).astype(complex)))


def _rightmost(values: Complex) -> Complex:
    return values[np.argsort(-values.real, kind="stable")]

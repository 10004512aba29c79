"""The coefficients of the integration methods."""

from __future__ import annotations

# ARS(4,4,3) of Ascher, Ruuth & Spiteri (1997), third order: explicit coefficients for the arm, singly diagonally
# implicit and stiffly accurate ones (gamma = 1/2, L-stable) for the law. The last stage is the step's result.
IMEX_STAGES = 4
NODES = (0.5, 2.0 / 3.0, 0.5, 1.0)
GAMMA = 0.5
EXPLICIT = (
    (0.5, 0.0, 0.0, 0.0),
    (11.0 / 18.0, 1.0 / 18.0, 0.0, 0.0),
    (5.0 / 6.0, -5.0 / 6.0, 0.5, 0.0),
    (0.25, 1.75, 0.75, -1.75),
)
IMPLICIT = (
    (0.0, 0.0, 0.0, 0.0),
    (0.0, 1.0 / 6.0, 0.0, 0.0),
    (0.0, -0.5, 0.5, 0.0),
    (0.0, 1.5, -1.5, 0.5),
)

# The classical Runge-Kutta method of fourth order, for the torque-driven arm.
RK4_NODES = (0.0, 0.5, 0.5, 1.0)
RK4_WEIGHTS = (1.0, 2.0, 2.0, 1.0)  # in sixths of a step

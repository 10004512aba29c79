"""Costs of control periods, with derivatives by the state after the period, by output and action.

The terms are metres: the tip's distance from the reference, smooth where it is 0; changes of the actions; deflections
near those that end an episode; and outputs of the network beyond the largest action, where nothing else has a slope.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flexarm_agents.descent.config import FOPGConfig
from flexarm_agents.descent.window import Window
from flexarm_env.envs.settings import Settings

Floats = NDArray[np.float64]


class Costs(NamedTuple):
    """Costs of the periods of a window.

    Attributes:
        total: Shape (T, n).
        by_after: derivatives by the states at the ends of the periods. Shape (T, n, 4 + 4 m).
        by_output: by the network's output, apart from the action. Shape (T, n, 2).
        by_action: by the action. Shape (T, n, 2).
        by_earlier: by the action of the period before. Shape (T, n, 2).
        errors: distances of the tip from the reference at the ends of the periods [m]. Shape (T, n).
    """

    total: Floats
    by_after: Floats
    by_output: Floats
    by_action: Floats
    by_earlier: Floats
    errors: Floats


def costs(window: Window, settings: Settings, config: FOPGConfig) -> Costs:
    """Compute costs and derivatives."""
    values, slopes = settings.flexible_arm.output_jacobians(window.after)
    away = values.true_tip - window.references
    squares = (away**2).sum(axis=-1)
    total, slope = error_cost(squares, config.error_knee)
    by_after = _pulled(2.0 * slope[..., None] * away, slopes.true_tip)
    if settings.deflection_limit is not None:
        bent = np.abs(values.deflection) / settings.deflection_limit
        excess = np.maximum(bent - config.deflection_share, 0.0)
        total = total + config.deflection_weight * (excess**2).sum(axis=-1)
        weights = 2.0 * config.deflection_weight / settings.deflection_limit * excess * np.sign(values.deflection)
        by_after += _pulled(weights, slopes.deflection)
    change = window.actions.astype(np.float64) - window.earlier
    beyond = np.maximum(np.abs(window.output) - 1.0, 0.0)
    total = total + config.change_weight * (change**2).sum(axis=-1) + config.excess_weight * (beyond**2).sum(axis=-1)
    by_action = 2.0 * config.change_weight * change
    by_output = 2.0 * config.excess_weight * beyond * np.sign(window.output)
    return Costs(total, by_after, by_output, by_action, -by_action, np.sqrt(squares))


def error_cost(squares: Floats, knee: float) -> tuple[Floats, Floats]:
    """Return the cost of squared distances [m], and its derivative by them [1/m].

    It is that square over twice the knee where it is small, and the distance less the knee where it is large.

    Args:
        squares: squared distances of the tip from the reference [m^2].
        knee: [m].
    """
    root = np.sqrt(squares + knee**2)
    return squares / (root + knee), 0.5 / root


def largest_cost(settings: Settings, config: FOPGConfig) -> float:
    """Return the cost of a period for an arm that is as far off as an episode allows [m].

    Args:
        settings: of the environments; without a limit, the arm is at most as far off as it is long twice.
        config: of the training.
    """
    limit = settings.error_limit
    farthest = 2.0 * settings.flexible_arm.parameters.reach if limit is None else limit
    return float(error_cost(np.array(farthest**2), config.error_knee)[0])


def _pulled(weights: Floats, slopes: Floats) -> Floats:
    return np.einsum("tni,tnij->tnj", weights, slopes)

"""Iterative learning: what repeats is learned, at a rate, and nothing is changed where nothing is wrong."""

import numpy as np
import pytest

from flexarm_baselines.lqg.ilc import Lap, learned
from flexarm_baselines.optimal import Plan
from tests.support.late_arm import ARM, START, plan


def run(now: Plan, disturbance: tuple[float, float], **quantities: float) -> Lap:
    """Drive the arm by a plan's torques, with a disturbance that no sensor sees."""
    states = ARM.rollout(START, now.torques + disturbance, **quantities).states
    return Lap(states, now.torques, ARM.tip(states[:, :4]))


@pytest.mark.parametrize(("disturbance", "payload"), [((3.0, -1.0), 0.0), ((0.0, 0.0), 0.2)])
def test_what_repeats_is_learned(disturbance: tuple[float, float], payload: float) -> None:
    """Each lap leaves a smaller error, whether the torques are disturbed or the arm is another."""
    now, target, errors = plan(), ARM.tip(plan().states[:, :4]), []
    for _ in range(6):
        lap = run(now, disturbance, payload_mass=payload)
        errors.append(np.linalg.norm(lap.tip - target))
        now = learned(now, lap, target)
    assert all(after < before for before, after in zip(errors[:-1], errors[1:], strict=True))
    assert errors[-1] < 0.2 * errors[0]


def test_without_an_error_the_next_lap_is_the_last() -> None:
    lap = run(plan(), (3.0, -1.0))
    after = learned(plan(), lap, lap.tip)
    np.testing.assert_allclose(after.torques, lap.torques)
    np.testing.assert_allclose(after.states, lap.states)


def test_the_prediction_is_what_the_model_then_does() -> None:
    """To first order: a tenth of the error leaves a hundredth of the difference."""
    off = []
    for share in (1.0, 0.1):
        lap = run(plan(), (0.0, 0.0))
        after = learned(plan(), lap, lap.tip + share * np.linspace(0.0, 0.05, len(lap.tip))[:, None])
        off.append(np.abs(run(after, (0.0, 0.0)).states - after.states).max())
    assert 0.0 < off[1] < 0.03 * off[0]


def test_refusals() -> None:
    lap = run(plan(), (0.0, 0.0))
    with pytest.raises(ValueError, match=r"tip: must have shape"):
        learned(plan(), lap._replace(tip=lap.tip[1:]), lap.tip)

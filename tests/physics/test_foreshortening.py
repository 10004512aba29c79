"""The foreshortened arm: what it adds to the linear one (its equations: test_dynamics)."""

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from flexarm_env import ArmParameters, FlexibleArm
from tests.support.lagrange import loaded_arm, random_state
from tests.support.refusals import refused

# Flapping frequencies of a uniform blade clamped to a turning root of radius zero, in units of sqrt(EI / rho L^4):
# Wright, Smith, Thresher & Wang, Vibration modes of centrifugally stiffened beams, J. Appl. Mech. 49 (1982), table 1.
BLADE = {0.0: (3.5160, 22.0345), 2.0: (4.1373, 22.6149), 5.0: (6.4495, 25.4461), 10.0: (11.2023, 33.6404)}


@pytest.mark.parametrize("turn", BLADE)
def test_a_turning_link_stiffens_like_a_blade(turn: float) -> None:
    """A huge hub turns link 1 at a constant rate; in the plane of rotation the blade's squares are less the turn's.

    The linear arm softens instead: its squares are those of the link at rest, less the turn's.
    """
    bare: dict[str, Any] = {"elbow_mass": 0.0, "payload_mass": 0.0, "payload_inertia": 0.0, "elbow_hub_inertia": 0.0}
    bare |= {"shoulder_hub_inertia": 1e9, "masses_per_length": (0.335, 1e-9), "damping_ratio": 0.0}
    for kinematics in ("linear", "foreshortened"):
        arm = FlexibleArm(loaded_arm(4, kinematics=kinematics, **bare))
        unit = np.sqrt(arm.parameters.flexural_rigidities[0] / (0.335 * arm.parameters.link_lengths[0] ** 4))
        state = np.zeros(2 * arm.size)
        state[arm.size] = turn * unit
        linear = arm.linearise(state, (0.0, 0.0)).A[arm.size + 2 : arm.size + 6, 2:6]  # q1'' by q1, the hub unmoved
        squares = np.sort(np.linalg.eigvals(-linear).real)[:2] / unit**2
        if kinematics == "foreshortened":
            # four modes of the resting beam: they bend more stiffly than the blade by the last digits given
            np.testing.assert_allclose(np.sqrt(squares + turn**2), BLADE[turn], rtol=1e-3)
        else:
            np.testing.assert_allclose(squares, np.array(BLADE[0.0]) ** 2 - turn**2, rtol=1e-4)


test_refusals = refused(
    (lambda: FlexibleArm().place(2, 5.0), r"s = 5\.0"),
    (lambda: FlexibleArm().place(3, 1.0), "link = 3"),
    (lambda: ArmParameters.paper(kinematics="foreshortened"), r"kinematics = 'foreshortened'.*must be 'complete'"),
)


def centre_line_excess(arm: FlexibleArm, q: NDArray[np.float64], link: int) -> float:
    """By how much a link's centre line is longer than the link, from 500 chords [m]."""
    length = arm.parameters.link_lengths[link - 1]
    points = arm.position(np.tile(q, (501, 1)), link, np.linspace(0.0, length, 501))
    return float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum()) - length


@pytest.mark.parametrize("link", [1, 2])
def test_a_bent_link_keeps_its_length(link: int) -> None:
    """(1 - w'^2/2)^2 + w'^2 = 1 + w'^4/4: the length errs in the fourth order, that of the linear arm in the second."""
    linear, foreshortened = (FlexibleArm(loaded_arm(2, kinematics=kind)) for kind in ("linear", "foreshortened"))
    q = random_state(linear.parameters, 3, deflection=0.5)[: linear.size]
    half = q.copy()
    half[2:] *= 0.5
    for arm, order in ((linear, 2), (foreshortened, 4)):
        large, small = centre_line_excess(arm, q, link), centre_line_excess(arm, half, link)
        assert large > 0.0
        assert np.log2(large / small) == pytest.approx(order, abs=0.15)  # the next order is 10 to 20 % of it
    assert centre_line_excess(foreshortened, q, link) < 0.1 * centre_line_excess(linear, q, link)

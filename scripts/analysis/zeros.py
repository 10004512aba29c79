"""Zeros against the sensor's position: which are there, where new ones come from, what they forbid."""

from typing import Any

import numpy as np
from scipy.optimize import brentq

from flexarm_env import ArmParameters, FlexibleArm
from flexarm_env.analysis import (
    OperatingPoint,
    linear_plant,
    link_zeros,
    sensitivity_peak,
    tip,
    true_point,
    zero_limits,
    zeros,
)

ELBOW = 1.5  # [rad]; for straight links the zeros do not depend on it
LOOP_BANDWIDTH = float(np.sqrt(150.79))  # [rad/s]; of the paper's law on a unit mass (11)
CORNER = (-6.3, 6.3)


def undamped(modes: int) -> FlexibleArm:
    """Make the linear arm with some number of modes, without damping."""
    return FlexibleArm(ArmParameters.linear(modes_per_link=modes, damping_ratio=0.0))


def entries(arm: FlexibleArm) -> list[float]:
    """Return the sensor positions at which a zero is at infinity [m]; there the response C A B is singular."""
    point = bent(arm)
    acceleration = point.linearisation.B[arm.size :]

    def response(position: float) -> float:
        return float(np.linalg.det(arm.point_jacobian(point.q, 2, position) @ acceleration))

    grid = np.linspace(0.02, 4.5, 450)
    values = [response(s) for s in grid]
    turns = np.nonzero(np.sign(values[:-1]) != np.sign(values[1:]))[0]
    return [float(brentq(response, grid[i], grid[i + 1])) for i in turns]


def bent(arm: FlexibleArm) -> OperatingPoint:
    """Return the resting arm with its elbow bent."""
    return OperatingPoint.at_angles(arm, (0.0, ELBOW))


def by_model(models: dict[str, FlexibleArm]) -> list[dict[str, Any]]:
    """Find each model's slowest right-half-plane zero at the tip, its limit, and where further zeros appear."""
    rows: list[dict[str, Any]] = []
    for name, arm in models.items():
        plant = linear_plant(OperatingPoint.at_point(arm, CORNER), tip())
        limit = zero_limits(plant)[0]
        rows.append(
            {
                "arm": name,
                "zero": limit.zero,
                "multiplicity": limit.multiplicity,
                "direction": limit.direction.tolist(),
                "bandwidth": limit.bandwidth,
                "peak": sensitivity_peak(limit.zero, LOOP_BANDWIDTH, 0.1),
                "right": [[v.real, v.imag] for v in zeros(plant).right_half_plane],
                "entries": entries(arm),
            }
        )
    exact = float(link_zeros(next(iter(models.values())), 1, 4.5, 1).real[0])
    rows.append(
        {
            "arm": "exact beam",
            "zero": exact,
            "multiplicity": 2,
            "bandwidth": 0.5 * exact,
            "peak": sensitivity_peak(exact, LOOP_BANDWIDTH, 0.1),
            "entries": [],
        }
    )
    return rows


def locus(models: dict[str, FlexibleArm], points: int) -> dict[str, Any]:
    """Find the zeros with Im >= 0 along link 2, on either side of the axis, for the picture."""
    positions = np.linspace(0.1, 4.5, points)
    found: dict[str, Any] = {"positions": positions.tolist()}
    for name, arm in models.items():
        point = bent(arm)
        each = (zeros(linear_plant(point, true_point(float(s)))).values for s in positions)
        found[name] = [[[float(v.real), float(v.imag)] for v in values if v.imag >= 0.0] for values in each]
    beams = (link_zeros(undamped(1), 2, float(s), 4) for s in positions)  # the first four of either kind
    found["exact beam"] = [{"real": one.real.tolist(), "imaginary": one.imaginary.tolist()} for one in beams]
    found["exact link 1"] = link_zeros(undamped(1), 1, 4.5, 3).real.tolist()
    return found


def study(points: int = 400) -> dict[str, Any]:
    """Find all about zeros."""
    counts = (1, 2, 3, 4)
    models = {f"{m} mode{'s' if m > 1 else ''}, undamped": undamped(m) for m in counts}
    damped = {"2 modes, 1 % (linear arm)": FlexibleArm(ArmParameters.linear())}
    default = {"3 polynomials, 1 % (default arm)": FlexibleArm()}
    return {
        "by_model": by_model(models | damped | default),
        "locus": locus({n: arm for n, arm in (models | damped).items() if not n.startswith("3")}, points),
    }

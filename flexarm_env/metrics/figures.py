"""What a lap is judged by."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any


@dataclass(frozen=True)
class CornerFigures:
    """How a lap went after one corner, until the next one.

    Attributes:
        time: instant of the corner [s].
        overshoot: largest advance of the true tip past the corner, in the direction in which the reference came [m];
            negative if the tip stayed short of it.
        settling_time: from the corner until the tip's distance from the reference stays below the band [s]; None if it
            does not before the next corner.
        residual_vibration: r.m.s. rate of the links' tip deflections, both links together, over the second half of
            the time until the next corner [m/s].
    """

    time: float
    overshoot: float
    settling_time: float | None
    residual_vibration: float


@dataclass(frozen=True)
class LapFigures:
    """Figures of a whole lap; pairs are of shoulder and elbow, or of link 1 and link 2.

    Attributes:
        rms: r.m.s. distance of the true tip from the reference [m].
        maximum: largest such distance [m].
        rms_after_2s: r.m.s. distance from 2 s on [m]; this and the other figures after 2 s: None of a shorter run.
        maximum_after_2s: [m].
        contour_rms: r.m.s. contour error [m], the distance across the reference's direction of travel.
        contour_max: its largest magnitude [m].
        lag_rms: r.m.s. lag error [m], the distance along the reference's direction of travel.
        lag_max: its largest magnitude [m].
        lag_mean: its mean, positive where the tip is behind [m].
        corners: one entry a corner.
        peak_deflection: largest deflections of the links' tips [m].
        rms_deflection: [m].
        peak_deflection_rate: [m/s].
        rms_deflection_rate: [m/s].
        peak_torque: [N m].
        rms_torque: [N m].
        torque_travel: sum of the magnitudes of the torque's changes from one control period to the next [N m].
        torque_change_after_2s: r.m.s. of these changes after 2 s [N m].
        energy: sum over periods and both motors of the work's magnitude: no work is recovered [J].
        net_work: what the motors gave to the arm [J].
        share_at_limit: share of the control periods with a torque at its limit; None where no limit is given.
        elbow_changes: times at which the elbow changed sides [s] (`elbow_changes`).
    """

    rms: float
    maximum: float
    rms_after_2s: float | None
    maximum_after_2s: float | None
    contour_rms: float
    contour_max: float
    lag_rms: float
    lag_max: float
    lag_mean: float
    corners: tuple[CornerFigures, ...]
    peak_deflection: tuple[float, float]
    rms_deflection: tuple[float, float]
    peak_deflection_rate: tuple[float, float]
    rms_deflection_rate: tuple[float, float]
    peak_torque: tuple[float, float]
    rms_torque: tuple[float, float]
    torque_travel: tuple[float, float]
    torque_change_after_2s: tuple[float, float] | None
    energy: float
    net_work: float
    share_at_limit: tuple[float, float] | None
    elbow_changes: tuple[float, ...] = ()

    def plain(self) -> dict[str, Any]:
        """Return a mapping of plain values for a file."""
        return asdict(self)

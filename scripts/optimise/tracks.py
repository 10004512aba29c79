"""What plans are made for: paths at their speeds, with the weights that their plans have, and the laboratory arm's."""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from flexarm_baselines.optimal import TrackingProblem, lap_problem
from flexarm_env.envs.registration import IDS
from flexarm_env.laps import LAPS
from flexarm_env.parameters import ArmParameters, SquareParameters
from flexarm_env.physics.paths import PATHS, way_points
from flexarm_env.simulation.arm import FlexibleArm
from flexarm_env.simulation.limits import rest_state

LAB, LAB_ARM = "lab", "quanser"  # the laboratory arm as its maker's data sheet has it
_LAB: dict[str, Any] = IDS["Lab-v0"].options
PACE = "pace"  # before the lap time in names of tracks
LAPS_OF_PACE = (14.0, 12.0, 10.0, 9.0, 8.0, 7.0, 6.0, 5.0)  # [s]
SIDES = {"square": 4, "line": 2}  # between points at which the reference turns at once; other paths: 1


class Track(NamedTuple):
    """A lap's reference, and what its plans are optimised by."""

    path: str = "square"  # a name of `flexarm_env.physics.paths.PATHS`
    lap_time: float = SquareParameters.lap_time  # [s]
    corner_time: float = 0.0  # [s]
    sides: int = 1  # sides of the path at whose starts the search changes the elbow's side
    weights: Mapping[str, float] = {}  # fields of `TrackingProblem` that differ from those of a lap
    compact: bool = True  # whether files of its plans have the first state only

    def task(self, lap: str) -> SquareParameters:
        """Return the square about the path."""
        return SquareParameters(lap_time=self.lap_time, elbow_branch=LAPS[lap].elbow_branch)

    def problem(self, arm: ArmParameters, lap: str, **weights: float) -> TrackingProblem:
        """Return the problem of a lap from rest; weights go before the track's own."""
        own: dict[str, Any] = {**self.weights, **weights}
        if self.path != LAB:
            own |= {"path": self.path, "corner_time": self.corner_time}
            return lap_problem(FlexibleArm(arm), self.task(lap), **own)
        task, period = self.task(lap), _LAB["control_period"]
        path = way_points(task, _LAB["waypoints"])
        times = np.minimum(period * np.arange(round(task.lap_time / period) + 1), path.lap_time)
        whole = FlexibleArm(arm)
        start = rest_state(whole, path.table[0, 1:], task.elbow_branch)
        own |= {"limits": _LAB["torque_limit"], "deflection_limit": 0.9 * _LAB["deflection_limit"]}
        return TrackingProblem(whole, start, path.position(times), period=period, **own)

    @property
    def options(self) -> dict[str, Any]:
        """Options of the environment with this reference."""
        if self.path == LAB:
            return dict(_LAB)
        return {"reference": self.path, "lap_time": self.lap_time, "corner_time": self.corner_time}


TRACKS: dict[str, Track] = {
    # `stops` is the task of an arm whose payload changes on the way
    **{name: Track(name, sides=SIDES.get(name, 1), compact=False) for name in PATHS if name != "stops"},
    "smooth": Track(corner_time=0.4, weights={"torque_weight": 1e-8, "change_weight": 1e-4}),
    **{f"{PACE}{lap_time:g}": Track(lap_time=lap_time) for lap_time in LAPS_OF_PACE},
    LAB: Track(LAB, weights={"torque_weight": 1e-9, "change_weight": 1e-7, "step": 5e-4}),
}

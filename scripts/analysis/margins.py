"""Margins of the paper's loop along the square, by the linear theory."""

from collections.abc import Callable, Iterable, Sequence
from functools import partial
from itertools import product
from typing import Any

import numpy as np

from flexarm_env import ArmParameters, FlexibleArm, SensorParameters, SquareParameters, square
from flexarm_env.analysis import LawLoop, delay_margin, gain_margin, law_loop, stable_gains
from flexarm_env.physics.damping import unit_damping

GAINS = {"FLSAC, smallest": 1.0 / 6.0, "FLSAC, largest": 5.0 / 6.0, "IFDC": 1.0}
SENSORS = {
    "end effector": {"position": 4.5},
    "0.5 m past the elbow": {"position": 0.5},
    "collocated, one delay": {"position": 4.5, "delay": 9.0 / SensorParameters().wave_speed},
}
DELAYED = ("position", "position+rate")
ARMS = {"paper's arm": ArmParameters.paper(), "linear arm": ArmParameters.linear()}
PLACES = {"corner": (-6.3, -6.3), "mid-side": (-6.3, 0.0)}
TIP_DAMPING = (0.01, 0.03)


def loop(arm: FlexibleArm, place: Any, sensor: str, delayed: str, gain: float) -> LawLoop:
    """Linearise the loop of one case."""
    return law_loop(arm, place, SensorParameters(delayed=delayed, **SENSORS[sensor]), gain)  # type: ignore[arg-type]


def study() -> dict[str, Any]:
    """Find all that the linear theory says of margins."""
    found = rows(ARMS, tuple(GAINS))
    return {
        "rows": found,
        "room": room(found),
        "by_modes": by_modes((1, 2, 3, 4)),
        "profile": profile(9, tuple(GAINS)),
        "largest_gains": largest_gains(ARMS, (1, 2)),
    }


def rows(arms: Iterable[str], controllers: Sequence[str]) -> list[dict[str, Any]]:
    """Find gain and delay margins of every case on a corner and in the middle of a side."""
    return [
        row(FlexibleArm(ARMS[title]), sensor, delayed, name) | {"arm": title}
        for title, sensor, delayed, name in product(arms, SENSORS, DELAYED, controllers)
    ]


def row(arm: FlexibleArm, sensor: str, delayed: str, controller: str) -> dict[str, Any]:
    """Find the margins of one case; `controller` is a name in `GAINS`."""
    gain = GAINS[controller]
    found: dict[str, Any] = {"sensor": sensor, "delayed": delayed, "controller": controller, "gain": gain}
    return found | everywhere(lambda at: loop(arm, at, sensor, delayed, gain), margins)


def everywhere(case: Callable[[Any], LawLoop], find: Callable[[LawLoop], Any]) -> dict[str, Any]:
    """Find something of a case at each of `PLACES`."""
    return {place: find(case(at)) for place, at in PLACES.items()}


def margins(case: LawLoop) -> dict[str, Any]:
    """Find both margins of one loop."""
    delay = delay_margin(case)
    gain = gain_margin(case, delay)
    return {
        "delay": case.delay,
        "delay_margin": delay.delay,
        "omega": delay.omega,
        "stable": gain.stable,
        "gain_up": gain.up,
        "gain_down": gain.down,
    }


def by_modes(modes: Iterable[int]) -> list[dict[str, Any]]:
    """Find the delay margins of the linear arm by its modes: IFDC, late rates, sensor at the end effector."""
    found = []
    for count in modes:
        arm = FlexibleArm(ArmParameters.linear(modes_per_link=count))
        late = partial(loop, arm, sensor="end effector", delayed="position+rate", gain=1.0)
        found.append({"modes": count} | everywhere(late, lambda case: delay_margin(case).delay))
    return found


def room(found: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return the least and largest ratio of margin and delay for each arm, sensor and kind of late reading."""
    ratios: dict[tuple[str, str, str], list[float]] = {}
    for row in found:
        for place in PLACES:
            ratio = row[place]["delay_margin"] / row[place]["delay"]
            ratios.setdefault((row["arm"], row["sensor"], row["delayed"]), []).append(ratio)
    keys = ("arm", "sensor", "delayed")
    return [dict(zip(keys, case, strict=True)) | {"least": min(r), "most": max(r)} for case, r in ratios.items()]


def profile(points: int, controllers: Sequence[str]) -> dict[str, Any]:
    """Find the delay margins of the paper's arm along half of the first side; the rest of the square is alike."""
    path = square(SquareParameters())
    arm = FlexibleArm(ArmParameters.paper())
    shares = np.linspace(0.0, 0.5, points)
    at = path.position(shares * path.lap_time / 4.0)
    curves = []
    for sensor, delayed, name in product(SENSORS, DELAYED, controllers):
        values = [delay_margin(loop(arm, place, sensor, delayed, GAINS[name])).delay for place in at]
        curves.append({"sensor": sensor, "delayed": delayed, "controller": name, "margin": values})
    side = SquareParameters().side
    return {"arc": (shares * side).tolist(), "side": side, "curves": curves}


def largest_gains(arms: Iterable[str], modes_per_link: Iterable[int]) -> list[dict[str, Any]]:
    """Find the largest stable lambda: with late rates at the paper's delays, and on the true tip without delay."""
    cases: dict[str, Callable[[Any], LawLoop]] = {}
    for title, sensor in product(arms, ("end effector", "0.5 m past the elbow")):
        late = partial(loop, FlexibleArm(ARMS[title]), sensor=sensor, delayed="position+rate", gain=1.0)
        cases[f"{title}, late rates, {sensor}"] = late
    clamped = unit_damping(ArmParameters.linear()).clamped_ratio
    for modes, damping in product(modes_per_link, TIP_DAMPING):
        arm = FlexibleArm(ArmParameters.linear(modes_per_link=modes, damping_ratio=damping / clamped))
        tip = partial(law_loop, arm, sensor=SensorParameters(model="true", delay=0.0))
        cases[f"true tip, not late, {modes} mode{'s' if modes > 1 else ''}, {100 * damping:g} %"] = tip
    return [{"what": what} | everywhere(case, largest) for what, case in cases.items()]


def largest(case: LawLoop) -> float:
    """Return the upper end of the interval of stable gains that begins at 0; 0 if there is none."""
    intervals = stable_gains(case)
    return intervals[0].high if intervals and intervals[0].low == 0.0 else 0.0

"""What tables are made from: a controller of the registry with its design, on both standard laps."""

from collections.abc import Mapping, Sequence
from statistics import median
from types import MappingProxyType
from typing import Any

from flexarm_agents.evaluation.candidates import ENVIRONMENT, from_controller
from flexarm_agents.evaluation.scoring import Score, score
from flexarm_env.laps import LAPS
from flexarm_env.rollout import run_policy

ERRORS = ("swing lap [mm]", "plain lap [mm]")  # see `cell`
Options = Mapping[str, Any]
NONE: Options = MappingProxyType({})
DRAWS = 9  # of the noise, for a lap that is lost with the first one


def run_laps(
    controller: str, design: Options = NONE, options: Options = NONE, off: tuple[float, float] = (0.0, 0.0)
) -> dict[str, list[dict[str, Any]]]:
    """Return the scores of a controller on both laps; a lap that the first draw of the noise loses has one for each.

    The design has arguments of its `for_env`, the options go beside its own. The joints begin so far `off` the first
    corner [rad].
    """
    candidate = from_controller(controller, ENVIRONMENT, options, **design)
    laps = {}
    for name, lap in LAPS.items():
        begin = lap.reset_options()
        if any(off):
            state = candidate.env.reset(options=begin)[1]["state"]
            state[:2] += off
            begin = {**begin, "state": state}
        found: list[Score] = []
        while not found or ("noise" in options and not found[0].complete and len(found) < DRAWS):
            found.append(score(run_policy(candidate.env, candidate.policy, seed=len(found), options=begin)))
        laps[name] = [one.as_mapping() for one in found]
    candidate.env.close()
    return laps


def drawn(**quantities: float) -> dict[str, Any]:
    """Return options of an arm some of whose quantities differ from what is published."""
    return {"randomisation": {name: (value, value) for name, value in quantities.items()}} if quantities else {}


def cell(lap: Sequence[Mapping[str, Any]], digits: int = 0) -> str:
    """Write r.m.s. over a lap / after 2 s [mm]; of one that was lost, the median time of the end, and its range."""
    if lap[0]["complete"]:
        return " / ".join(f"{1e3 * lap[0][name]:.{digits}f}" for name in ("rms", "rms_after_2s"))
    ends = [one["duration"] for one in lap if not one["complete"]]
    share = "" if len(ends) == len(lap) else f" {len(ends)} of {len(lap)}"
    least, middle, most = (f"{time:.1f}" for time in (min(ends), median(ends), max(ends)))
    return f"lost{share} at {middle} s" + ("" if least == most else f" ({least} to {most})")

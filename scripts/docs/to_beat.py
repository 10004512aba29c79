"""Best known numbers of each id for its page: from the leaderboard's data, the plans' and the trainings'."""

import json
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from typing import Any, NamedTuple

import numpy as np

from flexarm_agents.board.measure import PUBLISHED
from flexarm_baselines.lqg.race import race_plan
from flexarm_baselines.optimal.plan import PLANS
from flexarm_env.envs.documentation import table
from flexarm_env.laps import LAPS

BOARD = "[leaderboard](../leaderboard.md)"
KNOWS = {"true state": "the true state (a yardstick)", "plant parameters": "the arm's parameters"}

CARRIED = {"vibration": "vibration [mm]", "settling_time": "settling time [s]", "moment": "bending moment [N m]"}
MOST = 3  # entries that are shown of many

Laps = Mapping[str, Sequence[Mapping[str, Any]]]  # of each lap the summaries of some points


class OnBoard(NamedTuple):
    """Points of the leaderboard, and who is shown of those that were measured there."""

    column: str  # of the leaderboard
    values: tuple[Any, ...]  # of its points; their episodes are put together
    rows: tuple[str, ...]  # names on the leaderboard
    note: str = ""  # what the reader should know of the numbers


UNKNOWN = "0 to 15"  # the first of the ranges of episodes that the column "unknown" puts together
BY_ID: Mapping[str, OnBoard] = {
    "Square-v0": OnBoard("nominal", ("square",), ("plan_lqr", "hinf", "lqg", "agent student_gauges", "agent square")),
    "SquareGain-v0": OnBoard("nominal", ("square",), ("agent scheduler", "ifdc", "flsac")),
    "SquareChain-v0": OnBoard("nominal", ("chain",), ("hinf", "lqg_adaptive", "plan_lqr", "agent student_unknown")),
    "SquareEncoders-v0": OnBoard(
        "nominal", ("square",), ("shaped", "computed_torque"), "No learned policy has been measured on these sensors."
    ),
    "SquareUnknown-v0": OnBoard(
        "unknown",
        (UNKNOWN,),
        ("nmpc_state", "agent student_unknown", "agent student_unknown_stamped", "agent unknown", "lqg_adaptive"),
    ),
    "SquareDelayEasy-v0": OnBoard(
        "nominal",
        ("square",),
        ("plan_lqr", "lqg", "agent student"),
        "Measured with a sensor 31.2 ms late, the default arm's own delay.",
    ),
    "SquareDelayMedium-v0": OnBoard(
        "delay",
        tuple(float(delay) for delay in range(0, 61, 10)),
        ("lqg_adaptive_stamped", "lqg_adaptive", "agent student_unknown", "agent filtered"),
        "Laps with delays of 0, 10, ..., 60 ms.",
    ),
    "Reach-v0": OnBoard("nominal", ("reach",), ("agent universal", "agent square")),
    "Track-v0": OnBoard("nominal", ("track",), ("plan_lqr", "hinf", "lqg", "shaped", "agent universal")),
}


@cache
def board() -> dict[str, Any]:
    """Read the leaderboard's data."""
    found: dict[str, Any] = json.loads(PUBLISHED.read_text(encoding="utf-8"))
    return found


def to_beat(name: str) -> str:
    """Write the section of an id: a table, a sentence, or that there is nothing yet."""
    return _OTHERS[name]() if name in _OTHERS else _of_board(BY_ID[name])


def _of_board(wanted: OnBoard) -> str:
    rows = _ordered(wanted)
    heads = [f"{_title(lap, wanted)} [mm]" for lap in rows[0][1]]
    lines = table(("entry", "is given", "laps lost", *heads), [_line(*one) for one in rows])
    note = f"{wanted.note} " if wanted.note else ""
    return f"{note}Errors, r.m.s. over the lap / after 2 s, mean of complete laps ({BOARD}):\n\n{lines}"


def best(name: str) -> str:
    """Write the best entries without the true state in a sentence: that with least error, and the best agent."""
    if name in _OTHERS:
        return _BEST.get(name, "")
    wanted = BY_ID[name]
    rows = [one for one in _ordered(wanted) if not one[0]["privileged"]]
    first = rows[0]
    agents = [one for one in rows if one[0]["name"].startswith("agent ")]
    chosen = [first] + [one for one in agents[:1] if one is not first]
    titles = " / ".join(_title(lap, wanted) for lap in first[1])
    parts = []
    for row, laps in chosen:
        errors = [_mean(points, "rms") for points in laps.values()]
        lost, count = _losses(laps)
        figures = " / ".join("lost" if one is None else f"{1e3 * one:.1f}" for one in errors)
        parts.append(f"`{row['name']}` {figures} mm{f' ({lost} of {count} laps lost)' * (lost > 0)}")
    titles = f"[{titles}](../concepts.md#the-task)" if "lap" in titles else titles
    return f"Best so far, {titles}: {', '.join(parts)}."


def _ordered(wanted: OnBoard) -> list[tuple[Mapping[str, Any], Laps]]:
    """Return the wanted rows of the leaderboard with their laps, the best first."""
    rows = [(row, laps) for row in board()["rows"] if row["name"] in wanted.rows and (laps := laps_of(row, wanted))]
    assert len(rows) == len(wanted.rows), wanted
    return sorted(rows, key=lambda one: order(one[1]))


def _title(lap: str, wanted: OnBoard) -> str:
    """Name a lap; those of a circle have no elbow that must swing."""
    if lap not in LAPS:
        return "episode"
    return f"theta2 {'>' if lap == 'swing' else '<'} 0" if "track" in wanted.values else f"{lap} lap"


def laps_of(row: Mapping[str, Any], wanted: OnBoard) -> Laps | None:
    """Return what a row of the board came to at the wanted points, by laps; None if it was not measured there."""
    points = row["columns"][wanted.column]["points"]
    values = board()["columns"][wanted.column]["values"]
    found = [points[values.index(value)] for value in wanted.values]
    if any(one is None or "not_applicable" in one for one in found):
        return None
    return {lap: [one[lap] for one in found] for lap in found[0]}


def order(laps: Laps) -> tuple[float, float]:
    """Return by what entries are put in order: the share of lost episodes, then the error of both laps [m]."""
    lost, count = _losses(laps)
    means = [_mean(points, "rms") for points in laps.values()]
    return lost / count, sum(np.inf if mean is None else mean for mean in means)


def _losses(laps: Laps) -> tuple[int, int]:
    """Return how many episodes were lost, and of how many."""
    episodes = [point for points in laps.values() for point in points]
    return sum(one["lost"] for one in episodes), sum(one["episodes"] for one in episodes)


def _line(row: Mapping[str, Any], laps: Laps) -> tuple[str, ...]:
    """Write an entry's line of the table."""
    pairs = [[_mean(points, key) for key in ("rms", "rms_after_2s")] for points in laps.values()]
    cells = [" / ".join("-" if mean is None else f"{1e3 * mean:.1f}" for mean in pair) for pair in pairs]
    given = ", ".join(text for reading, text in KNOWS.items() if reading in row["reads"]) or "sensors only"
    return (f"`{row['name']}`", given, "{} of {}".format(*_losses(laps)), *cells)


def _mean(points: Sequence[Mapping[str, Any]], key: str) -> float | None:
    """Return the mean over the complete laps of some points; None if there is none."""
    complete = [(point["episodes"] - point["lost"], point[key]["mean"]) for point in points if point[key]]
    if not complete:
        return None
    counts, means = zip(*complete, strict=True)
    return float(np.average(means, weights=counts))


def _moves() -> str:
    """Write what the best known plans and the board say of drawn moves."""
    plans = json.loads((PLANS / "moves.json").read_text(encoding="utf-8"))
    errors, most = ([1e3 * plan[key] for plan in plans] for key in ("true_tip_rms", "true_tip_max"))
    known = f"The best known plans of seeds 0 to {len(plans) - 1} have {min(errors):.2f} to {max(errors):.2f} mm"
    known += f" (r.m.s.; {max(most):.1f} mm at most)"
    return (
        f"{known} ([optimal control](../optimal.md)), with the true state and no disturbance. No policy trained on "
        f"this id has been measured. {_of_board(BY_ID['Reach-v0'])}"
    )


def _smooth() -> str:
    """Write what the best known plans come to, and the board's entries."""
    known = [json.loads((PLANS / f"default_smooth_{lap}.json").read_text(encoding="utf-8"))["score"] for lap in LAPS]
    errors = ", ".join(
        f"{1e3 * one['true_tip_rms']:.1f} / {1e3 * one['true_tip_rms_after_2s']:.3f} mm on the {lap} lap"
        for lap, one in zip(LAPS, known, strict=True)
    )
    text = f"The best known plans err by {errors}, over the lap / after 2 s ([optimal control](../optimal.md))."
    return f"{text} {_of_board(OnBoard('nominal', ('smooth',), ('plan_lqr', 'lqg', 'shaped', 'agent square')))}"


def _race() -> str:
    """Write what the race's plans come to, and who follows them."""
    first, fastest, whole = race_plan().notes["lap_times"]
    rows = {row["name"]: row["columns"]["race"]["points"] for row in board()["rows"] if "race" in row["columns"]}
    known, others = (point["all"] for point in rows["race_mpcc"])
    unknown, lost = others["three_laps"], others["lost"] or "none"
    agent = rows["agent race"][0]["all"]["three_laps"]
    return f"""\
The paper goes round once in 16 s. `race_lqg`, along the best known plan (`python -m scripts.optimise.race`), needs
{first:.2f} s for the first lap, {fastest:.2f} s for the fastest, and {whole:.2f} s for all three; the agent `race`
{agent["median"]:.2f} s. On unknown arms both are lost: they use the whole 0.25 m. `race_mpcc`, predictive contouring
control, needs {known["three_laps"]["median"]:.2f} s, on unknown arms {unknown["least"]:.1f} to
{unknown["most"]:.1f} s, and loses {lost} of {others["episodes"]} ([races on unknown
arms](../lqg.md#races-on-unknown-arms)).

![The fastest lap of the best known race beside the paper's, in real time](../figures/race.webp)"""


def _carry() -> str:
    """Write what the board has of payloads that nobody knows."""
    drawn, nominal = (OnBoard("carry", (value,), ()) for value in ("0.2 to 1.5 kg", "nominal mass"))
    rows = []
    for row in board()["rows"]:
        points = {} if row["privileged"] else laps_of(row, drawn) or {}
        if points and all(lap["vibration"] and lap["vibration"]["p90"] for lap, *_ in points.values()):
            rows.append((max(lap["vibration"]["p90"] for lap, *_ in points.values()), _carried(row["name"], points)))
    plan = next(row for row in board()["rows"] if row["name"] == "plan_lqr")
    best = _carried("plan_lqr", laps_of(plan, nominal) or {}, "; true state, nominal mass")
    lines = table(("entry", "lost", *CARRIED.values()), [best, *(line for _, line in sorted(rows)[:MOST])])
    return f"Masses of 0.2 to 1.5 kg, 90th percentiles, swing / plain side, best first ({BOARD}):\n\n{lines}"


def _carried(name: str, points: Laps, note: str = "") -> tuple[str, ...]:
    laps = [[lap[figure] and lap[figure]["p90"] for figure in CARRIED] for lap, *_ in points.values()]
    cells = (
        " / ".join("-" if value is None else f"{scale * value:.2g}" for value in each)
        for scale, each in zip((1e3, 1.0, 1.0), zip(*laps, strict=True), strict=True)
    )
    return (f"`{name}`{note}", "{} of {}".format(*_losses(points)), *cells)


_NOT_YET = f"""\
None yet: no entry of the {BOARD} was measured with a drawn delay, jitter and lost readings together. Each alone is an
axis of it."""
_PAPER = """\
The leaderboard does not measure this set-up. What the paper's two controllers do here, and which of the paper's claims
hold, is in [the paper, reproduced](../reproduction.md)."""
_LAB = """\
[Published arms](../how_to/published_arms.md#flexarmlab-v0) has the scores of controllers that are designed on this arm,
the [leaderboard](../leaderboard.md#the-laboratory-arm) those of controllers that are designed on the data sheet's."""
_BEST: Mapping[str, str] = {
    "SquareResidual-v0": "PPO, SAC and TQC halve the springs' error of the swing lap.",
    "SquareDelayHard-v0": "No entry has been measured on it.",
    "Reach-v0": "Of the agents with limited torques `universal` alone loses no episode; it rests at some of the goals.",
}
_RESIDUAL = """\
No entry of the board uses this action. Medians of ten seeds, swing lap / plain lap, r.m.s. over the lap, none lost: PPO
with 500,000 steps 297 / 115 mm, SAC with 200,000 steps 288 / 109 mm, TQC with 200,000 steps 269 / 174 mm
([log](../developers/log.md#what-learning-adds-to-a-classical-law))."""
_OTHERS: Mapping[str, Callable[[], str]] = {
    "SquareResidual-v0": lambda: _RESIDUAL,
    "SquareDelayHard-v0": lambda: _NOT_YET,
    "Reach-v0": _moves,
    "Lab-v0": lambda: _LAB,
    "Carry-v0": _carry,
    "SmoothSquare-v0": _smooth,
    "Race-v0": _race,
    "Paper-v0": lambda: _PAPER,
}

"""The median one of trainings that differ in their seeds, and its files in the package."""

import shutil
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from flexarm_agents import Spread, load_policy
from flexarm_agents.evaluation.races import RaceScores
from flexarm_agents.evaluation.scoring import rank
from flexarm_agents.files import put, write_json
from flexarm_agents.training.run_folder import RunFolder
from flexarm_env.laps import LAPS
from scripts.common.trainings import Training

RULE = "the median of {count} trainings that differ in their seeds, by {figure}"


def median(trainings: Sequence[Training]) -> Training:
    """Return the training whose best policy is in the middle by `scoring.rank`; of two in the middle, the worse."""
    ranked = sorted(trainings, key=lambda one: rank([one.score]))
    return ranked[len(ranked) // 2]


def export(
    trainings: Sequence[Training], boards: Sequence[dict[str, Any]], policies: Path, name: str, command: str
) -> None:
    """Put the median training's best policy into the package, with its card beside it."""
    chosen = median(trainings)
    put(policies / f"{name}.npz", lambda aside: shutil.copyfile(RunFolder(chosen.folder).best, aside))
    policy = load_policy(policies / f"{name}.npz")
    with policy.make_env() as env:
        blocks = env.get_wrapper_attr("observation_blocks")
    card = {
        "command": command,
        **policy.notes,
        "observes": {block: part.stop - part.start for block, part in blocks.items()},
        "spread": _spread(trainings),
        "choice": RULE.format(count=len(trainings), figure=_figures(trainings)[0]),
        "trainings": [
            {"seed": one.config.seed, **one.best, **({"board": boards[n]} if boards else {})}
            for n, one in enumerate(trainings)
        ],
    }
    write_json(policies / f"{name}.json", card)


def _figures(trainings: Sequence[Training]) -> tuple[str, tuple[str, ...]]:
    """Return by what trainings are compared, and the figures of a lap that a card has."""
    if any(isinstance(one.score, RaceScores) for one in trainings):
        return "the time of the race", ("duration",)
    return "the mean r.m.s. of both laps", ("rms", "rms_after_2s")


def _spread(trainings: Sequence[Training]) -> dict[str, dict[str, dict[str, float | None]]]:
    """Return median, interquartile mean and worst of each lap's errors [m], or a race's time [s]; None where lost."""
    scores = [one.score for one in trainings]
    found: dict[str, dict[str, dict[str, float | None]]] = {}
    for lap in LAPS:
        laps = [getattr(score, lap) for score in scores]
        spreads = {
            figure: Spread.of(getattr(one, figure) if one.complete else None for one in laps)
            for figure in _figures(trainings)[1]
        }
        found[lap] = {
            figure: {what: getattr(spread, what) for what in ("median", "interquartile_mean", "worst")}
            for figure, spread in spreads.items()
        }
    return found

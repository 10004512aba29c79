"""What stays of trainings: their curves, and what a study measured of each, as data beside the page.

Trainings themselves are not committed. Those that lie in a study's folder replace their own seeds' records, one by one;
the others' stay as long as the agent's configuration is the same.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from tqdm import tqdm

from flexarm_env.laps import LAPS
from scripts.common.curves import curve
from scripts.common.result_files import write_json
from scripts.common.trainings import Training
from scripts.learning.measured import seconds_per_million
from scripts.learning.study import FIGURES, Agent, Record, Records, Study, by_agent


def renewed(study: Study, found: Sequence[Training], folder: Path, known: Records) -> dict[str, Agent]:
    """Return what is known of each agent, with records of the trainings that were found.

    Args:
        study: the comparison.
        found: finished trainings.
        folder: of the study.
        known: records of before.
    """
    agents: dict[str, Agent] = {}
    trained = by_agent(found)
    with tqdm(total=len(found), unit="training", desc="measuring") as bar:
        for name, config in study.agents.items():
            old = known.get(name)
            records = {one.seed: one for one in (old.trainings if old else ())}
            for one in trained.get(name, ()):
                records[one.config.seed] = record(study, one, folder)
                bar.update()
            if records:
                # All on one machine, so that they compare.
                seconds = seconds_per_million(config, folder / "costs" / f"{name}.json") if study.timed else None
                agents[name] = Agent(config, seconds, [records[seed] for seed in sorted(records)])
    return agents


def record(study: Study, training: Training, folder: Path) -> Record:
    """Measure a training.

    Args:
        study: the comparison.
        training: a finished training of one of its agents.
        folder: of the study.
    """
    best = {lap: {name: training.best[lap][name] for name in FIGURES} for lap in LAPS}
    evaluations = curve(training)
    return Record(evaluations.pop("seed"), _rounded(best), evaluations, _rounded(study.measure(training, folder)))


def read(study: Study, path: Path) -> dict[str, Agent]:
    """Read the records of agents whose configuration has not changed since.

    Args:
        study: the comparison.
        path: of the file; it need not be there.
    """
    data = json.loads(path.read_text()) if path.is_file() else {}
    return {
        name: Agent(config, data[name]["seconds"], [Record(**one) for one in data[name]["trainings"]])
        for name, config in study.agents.items()
        if name in data and data[name]["config"] == config.plain()
    }


def write(agents: Records, path: Path) -> None:
    """Write records, each in a line of its own.

    Args:
        agents: by their names.
        path: of the file.
    """
    data = {
        name: {
            "config": one.config.plain(),
            "seconds": one.seconds,
            "trainings": [record._asdict() for record in one.trainings],
        }
        for name, one in agents.items()
    }
    write_json(path, data, levels=3)


def _rounded(value: Any) -> Any:
    """Return plain data whose numbers have six digits."""
    if isinstance(value, Mapping):
        return {name: _rounded(one) for name, one in value.items()}
    if isinstance(value, list | tuple):
        return [_rounded(one) for one in value]
    return float(f"{value:.6g}") if isinstance(value, float) else value

"""Reproduce Green & Sasiadek (IFAC 2008): the twelve runs, the figures, every number, every claim.

Writes `runs/*.npz` (every trajectory), `figures/` (PNG and SVG), `summary.json`, `numbers.json`, `claims.json`,
`sweeps.json` and Markdown tables of these. The output folder is complete or absent: work is done beside it and put
in its place at the end.
"""

import json
import time
import tomllib
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

from flexarm_env import ArmParameters
from scripts.common.command_line import read_options, run
from scripts.common.result_files import replacing
from scripts.paper.cases import CONTROLLERS, PLACES, SENSINGS, Controller, Place, Sensing, Study, all_cases
from scripts.paper.pipeline import reproduce

MARKER = "summary.json"  # a complete result folder has it


@dataclass
class Options:
    """Reproduce the paper: runs, figures, numbers, claims."""

    output: Path = Path("results/paper")
    """Folder for the results; an existing one is replaced when the new one is complete."""
    controllers: tuple[Controller, ...] = CONTROLLERS
    """Which controllers. Claims are decided only when all cases are run."""
    sensings: tuple[Sensing, ...] = SENSINGS
    """Which sensings."""
    places: tuple[Place, ...] = PLACES
    """Sensor at the end effector (tip) or 0.5 m past the elbow (elbow)."""
    K_s: float = 1.0
    """Output scale of FLSAC."""
    K_n: float = 5.0
    """Normalising factor of FLSAC."""
    lap_time: float = 16.0
    """Time of one lap [s]."""
    parameters: Path | None = None
    """JSON or TOML file with fields of ArmParameters to set in every arm."""
    sweeps: bool = True
    """Make the sweeps of gains, scales and alternative readings."""
    figures: bool = True
    """Draw the figures."""
    workers: int = 2
    """Worker processes."""


def read_parameters(path: Path | None) -> dict[str, Any]:
    """Read fields of `ArmParameters` from a file.

    Raises:
        ValueError: for another kind of file or an unknown field.
    """
    if path is None:
        return {}
    if path.suffix not in (".json", ".toml"):
        raise ValueError(f"parameters = {path}: must be a .json or .toml file")
    text = path.read_text()
    data = json.loads(text) if path.suffix == ".json" else tomllib.loads(text)
    if not isinstance(data, dict):
        raise ValueError(f"parameters = {path}: must hold one object with fields of ArmParameters, got {data!r}")
    known = [f.name for f in fields(ArmParameters)]
    unknown = sorted(set(data) - set(known))
    if unknown:
        raise ValueError(f"parameters = {path}: unknown field(s) {unknown}; ArmParameters has {known}")
    ArmParameters.linear(**data)  # bad values are refused here, before any work
    return data


def main() -> None:
    """Command line."""
    options = read_options("python -m scripts.paper", Options())
    start = time.perf_counter()
    study = Study(options.K_s, options.K_n, options.lap_time, read_parameters(options.parameters))
    cases = all_cases(options.controllers, options.sensings, options.places)
    if options.workers < 1:
        raise ValueError(f"workers = {options.workers}: must be an integer >= 1")
    with replacing(options.output, MARKER) as work:
        reproduce(study, cases, work, options.sweeps, options.figures, options.workers)
    print(f"{options.output}: complete after {time.perf_counter() - start:.1f} s")
    verdicts = options.output / "claims.json"
    if verdicts.exists():
        for claim in json.loads(verdicts.read_text()):
            print(f"  {claim['verdict']:26} {claim['id']:18} {claim['quote']}")


if __name__ == "__main__":
    run(main)

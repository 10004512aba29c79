"""Whether one agent drives paths and arms that its training never saw, beside those that know the path."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from flexarm_agents import load_policy, shipped_policies
from flexarm_agents.environments import make_batch
from flexarm_agents.evaluation.scoring import COMPLETE
from flexarm_agents.teaching.drawn_paths import LAP, TAUGHT, drawn_path
from flexarm_baselines.registry import controller
from flexarm_env.envs.registration import UNKNOWN_PLANT
from flexarm_env.laps import SETTLED
from flexarm_env.rollout import run_batch
from scripts.common.command_line import run
from scripts.common.markdown import millimetres, table
from scripts.common.result_files import write_json
from scripts.common.study import Study
from scripts.learning.agents import FOLDER

FILE = FOLDER / "any_path.json"  # of `python -m scripts.learning.any_path`
EPISODES = 256
SEED = 5_000_000  # of the first; trainings and their evaluations have others


def way_points(random: np.random.Generator) -> Any:
    """Draw a closed polygon about the shoulder, whose sides stay 2 m and more from it. Shape (5, 2)."""
    angle = random.uniform(0.0, 2.0 * np.pi) + 0.4 * np.pi * (np.arange(5) + random.uniform(-0.3, 0.3, 5))
    radius = random.uniform(4.0, 8.5, 5)
    return np.column_stack([radius * np.cos(angle), radius * np.sin(angle)])[:: random.choice([-1, 1])]


PATHS: dict[str, dict[str, Any]] = {
    "square": {},
    "square, corners blended over 0.4 s": {"corner_time": 0.4},
    "circle": {"reference": "circle"},
    "figure eight": {"reference": "figure_eight"},
    "square from rest to rest, 24 s": {"reference": "stops", "lap_time": 24.0, "max_episode_steps": 2400},
    "square from rest to rest, 16 s": {"reference": "stops"},
    "five drawn way-points": {"reference": "drawn", "waypoints": way_points},
    "circle; 60 to 120 ms late, jitter of 20 ms, a tenth of the readings lost": {
        "reference": "circle",
        "jitter": 0.02,
        "dropout": 0.1,
        "randomisation": UNKNOWN_PLANT["randomisation"] | {"delay": (0.06, 0.12)},
    },
    "as in training": {"reference": "drawn", "waypoints": drawn_path, "lap_time": LAP},
}
ENTRIES = ("universal", "student_unknown", "lqg_adaptive")


def measured(name: str, path: str) -> dict[str, Any]:
    """Run an agent or a controller on unknown arms along a path; return how many it loses, and its errors [m]."""
    agent = load_policy(name) if name in shipped_policies() else None
    options = agent.options if agent else controller(name).options
    try:
        env = make_batch("FlexArm/SquareUnknown-v0", EPISODES, {**options, **PATHS[path]})
        policy = agent.policy if agent else controller(name).make(env)
    except ValueError as error:
        return {"refused": str(error)}
    steps = round(TAUGHT / env.control_period) if path == "as in training" else None
    runs = run_batch(env, [policy] * EPISODES, seed=SEED, max_steps=steps)
    env.close()
    first = round(SETTLED / env.control_period)
    squares: list[Any] = [np.sum(np.square(run.tip - np.asarray(run.reference)), axis=1) for run in runs]
    lost = np.array([run.notes["ended"] != COMPLETE for run in runs])
    rms, later = (
        np.where(lost, np.inf, [np.sqrt(x[since:].sum() / max(len(x) - since, 1)) for x in squares])
        for since in (0, first)
    )
    shown = [_quantile(rms, 0.5), _quantile(rms, 0.9), _quantile(later, 0.5)]
    return {"lost": int(lost.sum()), "errors": shown}


def results(folder: Path, jobs: int) -> Any:
    """Read the committed figures."""
    return json.loads(FILE.read_text())


def errors(found: Mapping[str, Mapping[str, Mapping[str, Any]]]) -> str:
    """Tabulate lost laps, median and 90th percentile."""
    return table(
        ("path", *(f"`{name}`" for name in ENTRIES)),
        [(path, *(_cell(found[name][path]) for name in ENTRIES)) for path in PATHS],
    )


def _cell(one: Mapping[str, Any]) -> str:
    return "needs a plan" if "refused" in one else f"{one['lost']}; {' / '.join(map(millimetres, one['errors']))}"


def _quantile(values: Any, share: float) -> float:
    return float(np.quantile(values, share, method="higher").round(5))


STUDY = Study(
    f"unknown arms on paths of which the training had none: lost of {EPISODES}; median, 90th percentile, median after "
    "2 s of the r.m.s. error [mm]",
    results,
    {"any_path": errors},
)


def main() -> None:
    """Measure all anew."""
    write_json(FILE, {name: {path: measured(name, path) for path in PATHS} for name in ENTRIES}, levels=3)


if __name__ == "__main__":
    run(main)

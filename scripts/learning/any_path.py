"""Whether one agent drives paths, tasks and arms that its training never saw, beside those that know the path."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from tqdm import tqdm

from flexarm_agents import Spread, load_policy, shipped_policies
from flexarm_agents.board.terms import task_options
from flexarm_agents.environments import make_batch, make_one, spec_of
from flexarm_agents.evaluation.scoring import COMPLETE
from flexarm_agents.teaching.drawn_paths import LAP, TAUGHT, drawn_path
from flexarm_baselines.registry import controller
from flexarm_env import ArmParameters, FlexibleArm
from flexarm_env.actions import TORQUE_LIMIT
from flexarm_env.allowed import allowed_of
from flexarm_env.analysis import OperatingPoint, natural_modes
from flexarm_env.envs.registration import IDS, LAB_ARM, UNKNOWN_PLANT
from flexarm_env.laps import SETTLED
from flexarm_env.published_arms import PUBLISHED
from flexarm_env.rollout import run_batch, run_policy
from flexarm_env.validation import choice
from scripts.common.command_line import read_options, run
from scripts.common.markdown import millimetres, table
from scripts.common.result_files import write_json
from scripts.common.study import Study
from scripts.learning.agents import FOLDER

FILE = FOLDER / "any_path.json"  # of `python -m scripts.learning.any_path`
EPISODES = 1024  # of an entry
OF_TRAINING = 256  # the first ones, of each training of `universal`
SEED = 5_000_000  # of the first; trainings and their evaluations have others


def way_points(random: np.random.Generator) -> Any:
    """Draw a closed polygon about the shoulder, whose sides stay 2 m and more from it. Shape (5, 2)."""
    angle = random.uniform(0.0, 2.0 * np.pi) + 0.4 * np.pi * (np.arange(5) + random.uniform(-0.3, 0.3, 5))
    radius = random.uniform(4.0, 8.5, 5)
    return np.column_stack([radius * np.cos(angle), radius * np.sin(angle)])[:: random.choice([-1, 1])]


def scaled(preset: str) -> dict[str, Any]:
    """Scale a published arm to the default arm's size, strength and pace; return the options that make it.

    Its links are 4.5 m long, the shoulder's largest torque is the default one, and the first frequency with locked
    joints and the elbow at a right angle is the default arm's: three scales, of length, time and mass, from which all
    else follows. Its payload is not drawn.
    """
    own, ours = ArmParameters.named(preset), ArmParameters()
    first, other = (_first_frequency(one) for one in (own, ours))
    torque, elbow = IDS["Lab-v0"].options["torque_limit"]
    length, time = ours.link_lengths[0] / own.link_lengths[0], first / other
    moment = TORQUE_LIMIT[0] / torque
    mass = moment * (time / length) ** 2
    factors = {
        "m": length,
        "kg": mass,
        "kg/m": mass / length,
        "kg m^2": mass * length**2,
        "N m": moment,
        "N m^2": moment * length,
        "N m s/rad": moment * time,
        "rad/s": 1.0 / time,
    }
    fields = {name: getattr(own, name) for name in PUBLISHED[preset].fields}
    units = {name: allowed_of(ArmParameters, name).unit for name in fields}
    fields |= {name: np.multiply(fields[name], factors[unit]).tolist() for name, unit in units.items() if unit}
    drawn = {name: ends for name, ends in UNKNOWN_PLANT["randomisation"].items() if name.endswith("delay")}
    return {"arm": fields, "torque_limit": (TORQUE_LIMIT[0], moment * elbow), "randomisation": drawn}


def _first_frequency(arm: ArmParameters) -> float:
    point = OperatingPoint.at_angles(FlexibleArm(arm), (0.0, 0.5 * np.pi))
    return float(natural_modes(point, "locked").frequencies[0])


# Options that differ from those of SquareUnknown-v0; beside them another id, or the name of an arm (`scaled`).
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
    "the moves of `Reach-v0`": task_options("Reach-v0"),
    "the loads of `Carry-v0`, 0.2 to 1.5 kg": {
        **task_options("Carry-v0"),
        "randomisation": UNKNOWN_PLANT["randomisation"] | {"payload_mass": (0.2, 1.5)},
        "max_episode_steps": 2400,
    },
    "circle; a laboratory arm, scaled": {"reference": "circle", "scaled": LAB_ARM},
    "square; the chain in MuJoCo, motors not late": {
        "environment": "FlexArm/SquareChain-v0",
        "randomisation": UNKNOWN_PLANT["randomisation"] | {"actuation_delay": (0.0, 0.0)},
    },
}
ERRORS = ("median", "90th percentile", "median after 2 s")  # of the r.m.s. error
ENTRIES = ("universal", "student_unknown", "lqg_adaptive")
Found = Mapping[str, Mapping[str, Any]]  # by entry or training, then by path


@dataclass
class Options:
    """Measure agents and controllers on unknown arms along paths that no training had."""

    trainings: Path | None = None
    """Folder of trainings of `universal` that differ in their seeds; they are measured instead."""
    paths: tuple[str, ...] = ()
    """Which paths; without, all. Those of others stay."""


def measured(name: str, path: str, episodes: int) -> dict[str, Any] | None:
    """Run an agent, by name or folder, or a controller on unknown arms along a path.

    Returns:
        How many it loses, and its errors [m]; None for a controller on the chain, where none is run.
    """
    agent = load_policy(name) if name in shipped_policies() or Path(name).is_dir() else None
    own = agent.options if agent else controller(name).options
    options = {**IDS["SquareUnknown-v0"].options, **own, **PATHS[path]}
    environment = options.pop("environment", "FlexArm/SquareUnknown-v0")
    if preset := options.pop("scaled", None):
        options |= scaled(preset)
    hosted = spec_of(environment).vector_entry_point is None
    if hosted and agent is None:
        return None
    try:
        env: Any = make_one(environment, options).unwrapped if hosted else make_batch(environment, episodes, options)
        policy = agent.policy if agent else controller(name).make(env)
    except ValueError as error:
        return {"refused": str(error)}
    steps = round(TAUGHT / env.control_period) if path == "as in training" else None
    if hosted:
        runs = [run_policy(env, policy, seed=SEED + n) for n in range(episodes)]
    else:
        runs = run_batch(env, [policy] * episodes, seed=SEED, max_steps=steps)
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


def errors(found: Found) -> str:
    """Tabulate lost laps, median and 90th percentile."""
    return table(
        ("path", *(f"`{name}`" for name in ENTRIES)),
        [(path, *(_cell(found[name].get(path)) for name in ENTRIES)) for path in PATHS],
    )


def seeds(found: Found) -> str:
    """Tabulate the trainings of `universal`: median, interquartile mean and worst of each figure."""
    trainings = [one for name, one in found.items() if name not in ENTRIES]
    head = ("path", "lost of all", f"lost of {OF_TRAINING}", *(f"{what} [mm]" for what in ERRORS))
    lines = []
    for path in PATHS:
        if not all(path in one for one in trainings):
            continue
        lost = [one[path]["lost"] for one in trainings]
        spreads = (Spread.of(one[path]["errors"][n] for one in trainings) for n in range(len(ERRORS)))
        whole = f"{sum(lost)} of {OF_TRAINING * len(lost)}"
        lines.append((path, whole, f"{np.median(lost):.0f} / {max(lost)}", *map(millimetres, spreads)))
    return table(head, lines)


def _cell(one: Mapping[str, Any] | None) -> str:
    if one is None:
        return "-"
    return "needs a plan" if "refused" in one else f"{one['lost']}; {' / '.join(map(millimetres, one['errors']))}"


def _quantile(values: Any, share: float) -> float:
    return float(np.quantile(values, share, method="higher").round(5))


STUDY = Study(
    f"unknown arms on paths of which the training had none: lost of {EPISODES}; median, 90th percentile, median after "
    "2 s of the r.m.s. error [mm]",
    results,
    {"any_path": errors, "any_path_seeds": seeds},
)


def main() -> None:
    """Measure the entries anew, or the trainings; what is not measured stays."""
    options = read_options("python -m scripts.learning.any_path", Options())
    given, paths = options.trainings, [choice("paths", path, tuple(PATHS)) for path in options.paths or PATHS]
    folders = [] if given is None else sorted(given.glob("seed-*"), key=lambda one: int(one.name.split("-")[1]))
    if given is not None and not folders:
        raise ValueError(f"trainings = {given}: must have folders seed-*, of `python -m scripts.shipped`")
    named = {one.name: str(one) for one in folders} or {name: name for name in ENTRIES}
    episodes = OF_TRAINING if folders else EPISODES
    for path, (name, source) in tqdm([*product(paths, named.items())], unit="run", desc="any_path"):
        one = measured(source, path, episodes)
        found = results(FOLDER, 1)
        write_json(FILE, found | {name: found.get(name, {}) | {path: one}}, levels=3)


if __name__ == "__main__":
    run(main)

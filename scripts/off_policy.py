"""Train SAC or TQC by the settings of agents/hyperparams, on the batch, and draw what they reach.

Each training leaves its curve in the folder of the results; `--docs` writes all that lie there into the page
docs/recipes/off_policy.md.
"""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any, Literal

import numpy as np
import torch
import tyro
import yaml
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.utils import LinearSchedule
from stable_baselines3.common.vec_env import VecMonitor
from tqdm import tqdm

from flexarm_agents import FlexArmVecEnv, evaluate
from flexarm_agents.environments import check_id, make_one
from flexarm_agents.run_folder import put
from flexarm_env.extras import needs_extra
from flexarm_env.validation import choice, integer
from scripts.common.command_line import run
from scripts.common.markdown import DOCS, filled, table
from scripts.common.result_files import write_json

HYPERPARAMS = DOCS.parent / "agents" / "hyperparams"
MODULES = {"sac": "stable_baselines3", "tqc": "sb3_contrib"}
PAGE, DATA, PICTURE = (DOCS / "recipes" / f"off_policy.{ending}" for ending in ("md", "json", "png"))
MARKERS = (".", "x", "s", "^")  # one for each round of the colours
EVALUATION_SEED = 1_000_003
Settings = dict[str, Any]
Curve = dict[str, Any]


@dataclass
class Options:
    """Train, or write the page."""

    algorithm: Literal["sac", "tqc"] = "sac"
    """Which one."""
    environment: str = "FlexArm/SquareResidual-v0"
    """Id of the environment; the settings' file has those that were thought of."""
    seed: int = 0
    """Seed of everything random."""
    steps: int | None = None
    """Environment steps; None: those of the settings. The learning rate falls to zero over them."""
    evaluate_every: int = 10_000
    """Steps between two evaluations."""
    output: Path = Path("results/off_policy")
    """Folder for the curves."""
    docs: bool = False
    """Train nothing: write data, picture and table of docs/recipes from the curves."""


def settings_of(algorithm: str, environment: str) -> Settings:
    """Read the settings of an algorithm, in rl-zoo3's format.

    Args:
        algorithm: name of a file of agents/hyperparams.
        environment: id.

    Raises:
        ValueError: if the file has none for the id.
    """
    known = yaml.safe_load((HYPERPARAMS / f"{algorithm}.yml").read_text(encoding="utf-8"))
    return dict(known[choice("environment", check_id(environment), known)])


def model_of(algorithm: str, settings: Mapping[str, Any], environment: str, seed: int) -> Any:
    """Make an untrained model with its environments.

    Args:
        algorithm: "sac" or "tqc".
        settings: as `settings_of` gives them.
        environment: id.
        seed: of everything random.
    """
    rest = {name: value for name, value in settings.items() if name != "n_timesteps"}
    env = VecMonitor(FlexArmVecEnv.make(environment, rest.pop("n_envs"), **rest.pop("env_kwargs")))
    rate = float(rest.pop("learning_rate").removeprefix("lin_"))
    with needs_extra("scripts.off_policy", "recipes"):
        made = getattr(import_module(MODULES[algorithm]), algorithm.upper())
    return made(env=env, learning_rate=LinearSchedule(rate, 0.0, 1.0), seed=seed, device="cpu", **rest)


class Follow(BaseCallback):
    """Evaluates now and then.

    Attributes:
        rows: the evaluations.
    """

    def __init__(self, environment: str, every: int, bar: tqdm[Any], keep: Callable[[Sequence[Any]], Any]) -> None:
        """Make the environment of the evaluations.

        Args:
            environment: id.
            every: steps between two evaluations.
            bar: shows the steps.
            keep: called with all evaluations after each.
        """
        super().__init__()
        self._env, self._every, self._bar, self._next = make_one(environment), every, bar, 0
        self._keep = keep
        self._began = time.process_time()
        self.rows: list[dict[str, Any]] = []

    def look(self) -> None:
        """Score the policy on both standard laps."""
        score = evaluate(self._env, self.model, EVALUATION_SEED)
        laps = {
            name: {"rms": lap.rms, "ended": lap.ended, "duration": lap.duration}
            for name, lap in score._asdict().items()
        }
        trained = self.model.ep_info_buffer or ()
        self.rows.append(
            {
                "steps": self.num_timesteps,
                "updates": self.model._n_updates,
                "seconds": round(time.process_time() - self._began, 1),
                "return": float(np.mean([one["r"] for one in trained])) if trained else None,
                "laps": laps,
            }
        )
        self._keep(self.rows)

    def _on_training_start(self) -> None:
        self.look()
        self._next = self._every

    def _on_step(self) -> bool:
        self._bar.update(self.num_timesteps - self._bar.n)
        if self.num_timesteps >= self._next:
            self._next += self._every
            self.look()
        return True


def trained(options: Options) -> Curve:
    """Train; the curve is written at each evaluation.

    Args:
        options: what and how.

    Returns:
        The settings with the evaluations.
    """
    environment = check_id(options.environment)
    settings = settings_of(options.algorithm, environment)
    steps = int(settings["n_timesteps"]) if options.steps is None else integer("steps", options.steps, 1)
    every, seed = integer("evaluate_every", options.evaluate_every, 1), integer("seed", options.seed, 0)
    curve: Curve = {"algorithm": options.algorithm, "environment": environment, "seed": seed, "steps": steps}
    curve["settings"] = settings
    path = options.output / f"{options.algorithm}-{environment.partition('/')[2]}-{seed}.json"
    options.output.mkdir(parents=True, exist_ok=True)
    torch.set_num_threads(1)
    model = model_of(options.algorithm, settings, environment, seed)
    with tqdm(total=steps, unit=" steps", unit_scale=True) as bar:
        follow = Follow(environment, every, bar, lambda rows: write_json(path, curve | {"rows": rows}))
        model.learn(steps, follow)
        follow.look()
    return curve | {"rows": follow.rows}


def curves_in(folder: Path) -> list[Curve]:
    """Read all curves of a folder.

    Raises:
        FileNotFoundError: if there is none.
    """
    found = [json.loads(path.read_text(encoding="utf-8")) for path in sorted(folder.glob("*.json"))]
    if not found:
        raise FileNotFoundError(f"output = {folder}: holds no curve; train first")
    return found


def rows_of(curves: Sequence[Curve]) -> list[list[str]]:
    """Return a line for each training: before and after it."""
    lines = []
    for curve in curves:
        first, last = curve["rows"][0], curve["rows"][-1]
        name = curve["environment"].removeprefix("FlexArm/")
        cells = [f"{_lap(first, lap)}, {_lap(last, lap)}" for lap in ("swing", "plain")]
        counts = [f"{last[key]:.0f}" for key in ("steps", "updates", "seconds")]
        returned = [row["return"] for row in curve["rows"] if row["return"] is not None]
        gain = f"{returned[0]:.0f}, {returned[-1]:.0f}" if returned else "-"
        lines.append([curve["algorithm"].upper(), f"`{name}`", str(curve["seed"]), *counts, gain, *cells])
    return lines


HEAD = [
    *("algorithm", "environment", "seed", "steps", "updates", "processor time [s]"),
    *("return of training episodes: first, last", "swing lap: before, after", "plain lap: before, after"),
]


def draw(curves: Sequence[Curve], path: Path) -> None:
    """Draw the returns of training episodes and the errors of both laps over the steps.

    Args:
        curves: of trainings.
        path: of the picture.
    """
    import matplotlib.pyplot as plt

    from scripts.common.plotting import COLOURS  # sets the look of all pictures

    figure, axes = plt.subplots(1, 2, figsize=(10.0, 3.8))
    for n, curve in enumerate(curves):
        colour, marker = COLOURS[n % len(COLOURS)], MARKERS[n // len(COLOURS) % len(MARKERS)]
        rows, name = curve["rows"], curve["environment"].removeprefix("FlexArm/")
        label = f"{curve['algorithm'].upper()}, {name}, seed {curve['seed']}"
        steps = [row["steps"] for row in rows]
        returns = [np.nan if row["return"] is None else row["return"] for row in rows]
        axes[0].plot(steps, returns, color=colour, marker=marker, label=label)
        for lap, style in (("swing", "-"), ("plain", "--")):
            errors = [np.nan if row["laps"][lap]["rms"] is None else row["laps"][lap]["rms"] for row in rows]
            axes[1].plot(steps, errors, style, color=colour, marker=marker)
    axes[0].set(xlabel="environment steps", ylabel="mean return of training episodes")
    axes[1].set(xlabel="environment steps", ylabel="r.m.s. error, complete laps [m]", ylim=(0.0, None))
    axes[0].legend(fontsize=8)
    axes[1].set_title("swing lap: solid, plain lap: dashed", fontsize=9)
    put(path, figure.savefig)
    plt.close(figure)


def write_docs(curves: Sequence[Curve], folder: Path) -> None:
    """Write data, picture and table of the page.

    Args:
        curves: of trainings.
        folder: of the results.
    """
    write_json(DATA, {"curves": list(curves)}, levels=3)
    draw(curves, PICTURE)
    put(folder / "off_policy.md", lambda aside: aside.write_text(table(HEAD, rows_of(curves))))
    page = filled(PAGE.read_text(encoding="utf-8"), folder)
    put(PAGE, lambda aside: aside.write_text(page, encoding="utf-8"))


def main() -> None:
    """Command line."""
    options = tyro.cli(Options, prog="python -m scripts.off_policy", description=__doc__)
    if options.docs:
        write_docs(curves_in(options.output), options.output)
        return
    print(table(HEAD, rows_of([trained(options)])), end="")


def _lap(row: Mapping[str, Any], lap: str) -> str:
    found = row["laps"][lap]
    return f"{found['ended']} at {found['duration']:.1f} s" if found["rms"] is None else f"{found['rms']:.3f} m"


if __name__ == "__main__":
    run(main)

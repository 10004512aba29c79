"""What keeps PPO's swing lap from the best plan's: starts, a curriculum, a teacher.

The ways are compared with the tuned settings of PPO and the starts that the environment has when nothing is said; the
tuned settings have had the starts on all corners since. All agents are judged on `Square-v0` as it is registered.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import gymnasium
import numpy as np
from matplotlib import pyplot as plt
from numpy.typing import NDArray

from flexarm_agents import Spread, TrainingConfig, load_policy
from flexarm_agents.contenders import from_controller
from flexarm_agents.environments import make_one
from flexarm_agents.run_folder import put
from flexarm_agents.scoring import COMPLETE
from flexarm_env.laps import LAPS, SETTLED
from flexarm_env.metrics import elbow_changes
from flexarm_env.predictor import predictor
from flexarm_env.rollout import run_policy
from flexarm_env.simulation.trajectory import Trajectory
from scripts.common.curves import FOLDER, curve
from scripts.common.markdown import table
from scripts.common.plotting import COLOURS
from scripts.common.spreads import spread_text
from scripts.common.trainings import Training
from scripts.learning.study import Found, Study

STEPS = 1_000_000
SQUARE = "FlexArm/Square-v0"
TAUGHT: dict[str, Any] = {
    "initial_policy": "student_gauges",
    "log_std": -2.5,
    "learning_rate": 3e-5,
    "final_learning_rate": 3e-6,
    "value_steps": STEPS // 10,
}
Runs = Mapping[str, Sequence[Mapping[str, Trajectory]]]  # of each agent, of each seed, by the lap
NOISES = (0.0, 0.1, 0.3)  # standard deviations of the noise on actions
EPISODES = 8  # of each lap with noise
PICTURE = "exploration.png"


class Way(NamedTuple):
    """A way of learning.

    Attributes:
        text: what is other than in the tuned settings.
        settings: of the configuration.
    """

    text: str
    settings: Mapping[str, Any]


WAYS = {
    "mix": Way("nothing: 30 % at rest on a corner, else moving", {}),
    "corner": Way("at rest on the first corner, whole laps", {"options": {"start": "corner"}, "episode_steps": 1600}),
    "moving": Way("moving starts only", {"options": {"start": "moving"}}),
    "slow": Way(
        "curriculum: laps of 32 s for a third", {"lesson_options": {"lap_time": 32.0}, "lesson_steps": STEPS // 3}
    ),
    "taught": Way(
        "begins as `student_gauges`, value first, on the corners",
        {**TAUGHT, "options": {"start": "corners"}},
    ),
    "corners": Way("at rest on any corner (tuned since)", {"options": {"start": "corners"}}),
}


def config_of(way: str) -> TrainingConfig:
    """Return the configuration of an agent.

    Args:
        way: a name in `WAYS`.
    """
    settings: dict[str, Any] = {"lesson_options": {}, **WAYS[way].settings}
    return TrainingConfig(steps=STEPS, evaluate_every=STEPS // 10, **settings)


class Start(NamedTuple):
    """Figures of a lap; errors are None where it was not completed.

    Attributes:
        rms: of the lap [m].
        first: in the first 2 s [m].
        later: after them [m].
        deflection: largest one of link 1 [m].
        passed: time at which the elbow changed sides first [s]; None: it did not in the first 2 s.
    """

    rms: float | None
    first: float | None
    later: float | None
    deflection: float
    passed: float | None


def start_of(run: Trajectory) -> Start:
    """Return the figures of a lap."""
    errors = distances(run)
    begins = run.time <= SETTLED
    complete = run.notes["ended"] == COMPLETE
    changes = [float(time) for time in elbow_changes(run) if time <= SETTLED]
    return Start(
        rms=_rms(errors) if complete else None,
        first=_rms(errors[begins]) if complete else None,
        later=_rms(errors[~begins]) if complete else None,
        deflection=float(np.abs(run.tip_deflection[:, 0]).max()),
        passed=changes[0] if changes else None,
    )


def distances(run: Trajectory) -> NDArray[np.float64]:
    """Return the distance of the true tip from the reference [m]. Shape (n,)."""
    assert run.reference is not None
    return np.asarray(np.linalg.norm(run.tip - run.reference, axis=1))


class Driver(NamedTuple):
    """A policy, and `SQUARE` with the observation that it has."""

    env: gymnasium.Env[Any, Any]
    policy: Any

    def laps(self) -> dict[str, Trajectory]:
        """Run both laps."""
        return {lap: run_policy(self.env, self.policy, seed=0, lap=lap) for lap in LAPS}

    def noisy_reward(self, deviation: float, lap: str) -> float:
        """Return the mean sum of the rewards in the first 2 s, over episodes with other noise.

        Args:
            deviation: standard deviation of the noise on each action.
            lap: name of the lap.
        """
        found = []
        for seed in range(EPISODES if deviation else 1):
            noisy = Noisy(self.policy, deviation, seed)
            run = run_policy(self.env, noisy, seed=0, max_steps=round(SETTLED / 0.01), lap=lap)
            found.append(_rewards(run).sum())
        return float(np.mean(found))


class Noisy:
    """A policy whose actions are disturbed."""

    def __init__(self, policy: Any, deviation: float, seed: int) -> None:
        """Take a policy.

        Args:
            policy: as `run_policy` takes it.
            deviation: standard deviation of the noise on each action.
            seed: of the noise.
        """
        self._predict, self._deviation = predictor(policy, True), deviation
        self._rng = np.random.default_rng(seed)

    def predict(
        self, observation: Any, state: Any = None, episode_start: Any = None, deterministic: bool = True
    ) -> tuple[NDArray[np.float32], Any]:
        """Return the policy's action with noise."""
        action, state = self._predict(observation, state, episode_start)
        noise = self._deviation * self._rng.standard_normal(np.shape(action))
        return np.clip(action + noise, -1.0, 1.0).astype(np.float32), state


def rewards(drivers: Mapping[str, Driver]) -> str:
    """Tabulate what the reward makes of motions: does it prefer the best plan's, and with noise as well?"""
    discount, rows = config_of("mix").gamma, []
    for text, driver in drivers.items():
        for lap, run in driver.laps().items():
            own = _rewards(run)
            discounted = float(own @ discount ** np.arange(len(own)))
            noisy = [f"{driver.noisy_reward(deviation, lap):.1f}" for deviation in NOISES]
            first = start_of(run).first
            error = "lost" if first is None else f"{first:.3f}"
            rows.append((text, lap, error, f"{own.sum():.0f}", f"{discounted:.1f}", *noisy))
    head = ("motion", "lap", "error, first 2 s [m]", "reward of the lap", f"discounted by {discount:g}")
    return table((*head, *(f"first 2 s, noise {deviation:g}" for deviation in NOISES)), rows)


def tables(found: Found, folder: Path) -> Mapping[str, str]:
    """Write the tables, and draw the picture of the swing lap's start."""
    env, plan = make_one(SQUARE), from_controller("plan_lqr", SQUARE, {})
    yardsticks = {
        "best plan, true state (`plan_lqr`)": Driver(plan.env, plan.policy),
        "taught (`student_gauges`)": Driver(env, load_policy("student_gauges").policy),
    }
    runs = {text: [driver.laps()] for text, driver in yardsticks.items()}
    ends: dict[str, list[float | None]] = {}
    for name in (name for name in WAYS if name in found):
        ends[WAYS[name].text] = [curve(one)["swing"][-1] for one in found[name]]
        drivers = [Driver(env, load_policy(one.folder).policy) for one in found[name]]
        runs[WAYS[name].text] = [driver.laps() for driver in drivers]
    draw(runs, folder / PICTURE)
    made = {"exploration": _table(runs, ends)}
    if "mix" in found:
        median = Driver(env, load_policy(_median(found["mix"]).folder).policy)
        made["exploration_rewards"] = rewards(yardsticks | {"PPO, nothing other, median seed": median})
    for one in (env, plan.env):
        one.close()
    return made


def _table(runs: Runs, ends: Mapping[str, Sequence[float | None]]) -> str:
    """Tabulate the laps of each agent's seeds; those that learned by reward also have the error at the end."""
    swing = ("swing: lap [m]", "first 2 s [m]", "after 2 s [m]", "bends link 1 by [m]", "elbow straight at [s]")
    head = ("what is other", "seeds", *swing, "at the end of the training: lap [m]", "plain: lap [m]")
    return table(head, list(_rows(runs, ends)))


def _rows(runs: Runs, ends: Mapping[str, Sequence[float | None]]) -> Iterator[tuple[str, ...]]:
    for text, several in runs.items():
        swings = [start_of(one["swing"]) for one in several]
        plains = [start_of(one["plain"]) for one in several]
        errors = [Spread.of(getattr(one, name) for one in swings) for name in ("rms", "first", "later")]
        passed = Spread.of(one.passed for one in swings).median
        yield (
            text,
            str(len(several)),
            *map(spread_text, errors),
            f"{np.median([one.deflection for one in swings]):.2f}",
            "-" if passed is None else f"{passed:.2f}",
            spread_text(Spread.of(ends[text])) if text in ends else "-",
            spread_text(Spread.of(one.rms for one in plains)),
        )


def draw(runs: Runs, path: Path) -> None:
    """Draw error and deflection of link 1 over the first seconds of the swing lap, of each agent's median seed."""
    figure, axes = plt.subplots(1, 2, figsize=(10.5, 5.6))
    for n, (text, several) in enumerate(runs.items()):
        swings = sorted((one["swing"] for one in several), key=lambda run: start_of(run).rms or np.inf)
        run = swings[(len(swings) - 1) // 2]
        shown = run.time <= SETTLED
        style = ("-", "--", ":")[n // len(COLOURS) % 3]
        look: dict[str, Any] = {"color": COLOURS[n % len(COLOURS)], "linestyle": style, "label": text}
        axes[0].plot(run.time[shown], distances(run)[shown], **look)
        axes[1].plot(run.time[shown], run.tip_deflection[shown, 0], **look)
    axes[0].set(xlabel="time [s]", ylabel="distance from the reference [m]", title="swing lap")
    axes[1].set(xlabel="time [s]", ylabel="deflection of link 1 [m]", title="swing lap")
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=2, fontsize=8)
    path.parent.mkdir(parents=True, exist_ok=True)
    put(path, figure.savefig)
    plt.close(figure)


def _median(trainings: Sequence[Training]) -> Training:
    """Return the training whose best policy has the median error of the swing lap."""
    ranked = sorted(trainings, key=lambda one: one.best["swing"]["rms"] or np.inf)
    return ranked[(len(ranked) - 1) // 2]


def _rewards(run: Trajectory) -> NDArray[np.float64]:
    """Return the reward of each step."""
    assert run.reward is not None
    return run.reward[1:]


def _rms(errors: NDArray[np.float64]) -> float:
    return float(np.sqrt(np.mean(np.square(errors))))


STUDY = Study(
    "PPO's start of the swing lap: errors of seeds, median, middle mean, worst",
    {name: config_of(name) for name in WAYS},
    10,
    tables,
    ("exploration", "exploration_rewards"),
    {PICTURE: FOLDER / PICTURE},
    partial=True,
    curves="exploration_curves",
)

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
from flexarm_agents.environments import make_one
from flexarm_agents.evaluation.candidates import from_controller
from flexarm_agents.evaluation.scoring import COMPLETE
from flexarm_env.laps import LAPS, SETTLED
from flexarm_env.metrics import elbow_changes
from flexarm_env.predictor import predictor
from flexarm_env.rollout import run_policy
from flexarm_env.simulation.trajectory import Trajectory
from scripts.common.markdown import table
from scripts.common.plotting import BLUE, COLOURS, ORANGE, SOFT, WIDTH, headline, label_ends, write
from scripts.common.spreads import millimetres
from scripts.common.trainings import Training
from scripts.learning.study import Records, Study

STEPS = 1_000_000
SQUARE = "FlexArm/Square-v0"
TAUGHT: dict[str, Any] = {
    "initial_policy": "student_gauges",
    "log_std": -2.5,
    "learning_rate": 3e-5,
    "final_learning_rate": 3e-6,
    "value_steps": STEPS // 10,
}
Laps = Mapping[str, Any]  # what `laps_of` returns
NOISES = (0.0, 0.1, 0.3)  # standard deviations of the noise on actions
EPISODES = 8  # of each lap with noise
PERIOD = 0.01  # of control [s]
STRIDE = 2  # of the control periods in the picture
PICTURE = "exploration.png"


class Way(NamedTuple):
    """A way of learning.

    Attributes:
        text: the change to the tuned settings.
        settings: of the configuration.
    """

    text: str
    settings: Mapping[str, Any]


WAYS = {
    "mix": Way("none: 30 % at rest on a corner, else moving", {}),
    "corner": Way("at rest on the first corner, whole laps", {"options": {"start": "corner"}, "episode_steps": 1600}),
    "moving": Way("moving starts only", {"options": {"start": "moving"}}),
    "slow": Way(
        "curriculum: laps of 32 s for a third", {"lesson_options": {"lap_time": 32.0}, "lesson_steps": STEPS // 3}
    ),
    "taught": Way(
        "begins as `student_gauges`, value first, on the corners",
        {**TAUGHT, "options": {"start": "corners"}},
    ),
    "corners": Way("at rest on any corner (the registered settings)", {"options": {"start": "corners"}}),
}


DRAWN = {
    "best plan, true state (`plan_lqr`)": ("best plan", SOFT),
    WAYS["taught"].text: ("PPO from the\nstudent's network", COLOURS[3]),
    WAYS["corners"].text: ("PPO from rest\non the corners", BLUE),
    WAYS["mix"].text: ("PPO from rest\nand moving", ORANGE),
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
            run = run_policy(self.env, noisy, seed=0, max_steps=round(SETTLED / PERIOD), lap=lap)
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


def measure(training: Training, folder: Path) -> dict[str, Any]:
    """Return what `laps_of` does, of the best policy."""
    env = make_one(SQUARE)
    try:
        return laps_of(Driver(env, load_policy(training.folder).policy))
    finally:
        env.close()


def laps_of(driver: Driver) -> dict[str, Any]:
    """Return what was measured of both laps, by their names.

    That is the fields of `Start`; the rewards' sum and discounted sum, and the sums of the first 2 s by the noise on
    the actions; of the swing lap, as the picture has them, distances and deflections of link 1 in the first 2 s [m].
    """
    discount, found, runs = config_of("mix").gamma, {}, driver.laps()
    for lap, run in runs.items():
        own = _rewards(run)
        found[lap] = {
            **start_of(run)._asdict(),
            "reward": float(own.sum()),
            "discounted": float(own @ discount ** np.arange(len(own))),
            "noisy": [driver.noisy_reward(deviation, lap) for deviation in NOISES],
        }
    swing = runs["swing"]
    drawn = {"distances": distances(swing), "deflections": swing.tip_deflection[:, 0]}
    found["swing"] |= {
        name: values[swing.time <= SETTLED][::STRIDE].round(4).tolist() for name, values in drawn.items()
    }
    return found


def tables(agents: Records, folder: Path) -> Mapping[str, str]:
    """Write the tables, and draw the picture of the swing lap's start."""
    env, plan = make_one(SQUARE), from_controller("plan_lqr", SQUARE, {})
    several: dict[str, list[Laps]] = {
        "best plan, true state (`plan_lqr`)": [laps_of(Driver(plan.env, plan.policy))],
        "student (`student_gauges`)": [laps_of(Driver(env, load_policy("student_gauges").policy))],
    }
    for one in (env, plan.env):
        one.close()
    preferred = {text: laps for text, (laps,) in several.items()}
    ends: dict[str, list[float | None]] = {}
    for name, agent in agents.items():
        several[WAYS[name].text] = [one.measured for one in agent.trainings]
        ends[WAYS[name].text] = [one.curve["swing"][-1] for one in agent.trainings]
    draw(several, folder / PICTURE)
    made = {"exploration": _table(several, ends)}
    if "mix" in agents:
        preferred["PPO, no change, median seed"] = _median(several[WAYS["mix"].text])
        made["exploration_rewards"] = rewards(preferred)
    return made


def rewards(motions: Mapping[str, Laps]) -> str:
    """Tabulate what the reward makes of motions: does it prefer the best plan's, and with noise as well?"""
    rows = []
    for text, laps in motions.items():
        for lap, one in laps.items():
            noisy = (f"{value:.1f}" for value in one["noisy"])
            returns = f"{one['reward']:.0f}", f"{one['discounted']:.1f}"
            rows.append((text, lap, millimetres(one["first"]), *returns, *noisy))
    discount = f"discounted by {config_of('mix').gamma:g}"
    head = ("motion", "lap", "error, first 2 s [mm]", "reward of the lap", discount)
    return table((*head, *(f"first 2 s, noise {deviation:g}" for deviation in NOISES)), rows)


def _table(several: Mapping[str, Sequence[Laps]], ends: Mapping[str, Sequence[float | None]]) -> str:
    """Tabulate the laps of each agent's seeds; those that learned by reward also have the error at the end."""
    swing = ("swing: lap [mm]", "first 2 s [mm]", "after 2 s [mm]", "bends link 1 by [m]", "elbow straight at [s]")
    counted = "seeds that swing"
    head = ("change", "seeds", counted, *swing, "at the end of the training: lap [mm]", "plain: lap [mm]")
    return table(head, list(_rows(several, ends)))


def _rows(
    several: Mapping[str, Sequence[Laps]], ends: Mapping[str, Sequence[float | None]]
) -> Iterator[tuple[str, ...]]:
    for text, seeds in several.items():
        swings = [one["swing"] for one in seeds]
        errors = [Spread.of(one[name] for one in swings) for name in ("rms", "first", "later")]
        passed = Spread.of(one["passed"] for one in swings)
        yield (
            text,
            str(len(seeds)),
            str(passed.complete),
            *map(millimetres, errors),
            f"{np.median([one['deflection'] for one in swings]):.2f}",
            "-" if passed.median is None else f"{passed.median:.2f}",
            millimetres(Spread.of(ends[text])) if text in ends else "-",
            millimetres(Spread.of(one["plain"]["rms"] for one in seeds)),
        )


def draw(several: Mapping[str, Sequence[Laps]], path: Path) -> None:
    """Draw error and deflection of link 1 over the first seconds of the swing lap, of some agents' median seeds."""
    figure, axes = plt.subplots(2, 1, figsize=(WIDTH, 6.2), sharex=True)
    drawn = {text: look for text, look in DRAWN.items() if text in several}
    for axis, name, scale in zip(axes, ("distances", "deflections"), (1e3, 1.0), strict=True):
        for text, (_, colour) in drawn.items():
            values = scale * np.array(_median(several[text])["swing"][name])
            axis.plot(STRIDE * PERIOD * np.arange(len(values)), values, color=colour, linewidth=1.8)
    axes[0].set(ylabel="error [mm]", title="Distance of the tip from the target", ylim=(0.0, None))
    axes[1].set(ylabel="deflection [m]", title="Bend of link 1", xlabel="time since the start of the swing lap [s]")
    for axis in axes:
        axis.set_xlim(0.0, SETTLED)
    label_ends(axes[0], [*drawn.values()], [800.0 - 150.0 * n for n in range(len(drawn))])
    headline(figure, "The start of the swing lap: the best plan, and the median training of three ways of PPO")
    write(figure, path)


def _median(seeds: Sequence[Laps]) -> Laps:
    """Return the laps of the seed whose swing lap has the median error."""
    ranked = sorted(seeds, key=lambda one: one["swing"]["rms"] or np.inf)
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
    measure,
    picture=PICTURE,
    partial=True,
)

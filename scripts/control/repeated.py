"""Iterative learning over ten laps: the error by lap, on the default arm, with payloads, and on unknown arms."""

from functools import partial
from typing import Any

import gymnasium
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

from flexarm_agents.evaluation.candidates import ENVIRONMENT
from flexarm_baselines.arrays import Floats
from flexarm_baselines.lqg import LQG
from flexarm_baselines.lqg.ilc import Lap, learned
from flexarm_env.envs.registration import UNKNOWN_PLANT
from flexarm_env.laps import LAPS, SETTLED
from scripts.common.markdown import table
from scripts.common.plotting import COLOURS, WIDTH, plain_ticks
from scripts.common.study import Trial, study
from scripts.control.trials import drawn

LEARNED, ARMS = 10, 16
NOISES = {name: value for name, value in UNKNOWN_PLANT.items() if name != "randomisation"}
ROWS = {"default arm": {}, "payload 0.5 kg": {"payload_mass": 0.5}, "delay 60 ms": {"delay": 0.06}}


def one_lap(env: Any, controller: LQG, lap: str, seed: int) -> tuple[Lap | None, float, Floats]:
    """Run a lap; return what is known after it (None if it is lost), the sensor's delay [s] and true errors [m]."""
    observation, info = env.reset(seed=seed, options=LAPS[lap].reset_options())
    plan, task, state, over, lost = controller.plans[0], controller.task, None, False, False
    states, torques, read, age, errors = [plan.states[0]], [], [], [], [info["tip_error"]]
    while not over:
        read.append(task.read(observation[None], "sensed_position")[0])
        age.append(task.read(observation[None], "reading_age")[0, 0])
        action, state = controller.predict(observation, state)
        assert state is not None
        observation, _, lost, over, info = env.step(action)
        states.append(state[0][0, : plan.states.shape[1]])
        torques.append(state[2][0])
        errors.append(info["tip_error"])
        over = over or lost
    delay = float(np.median(age))
    if lost:
        return None, delay, np.array(errors)
    shown = task.period * np.arange(len(read)) - np.array(age)  # when the tip was there
    times = task.period * np.arange(len(states))
    tip = np.stack([np.interp(times, shown, column) for column in np.array(read).T], axis=1)
    unseen = times > shown[-1]
    tip[unseen] = plan.arm.tip(plan.states[unseen, : plan.arm.size])
    return Lap(np.array(states), np.array(torques), tip), delay, np.array(errors)


def run_learning(lap: str, values: dict[str, float]) -> list[float | None]:
    """Return the errors of ten laps on one arm after 2 s [m]; None from a lost lap on."""
    blocks = {"observation": (*LQG.blocks, "reading_age")}
    env = gymnasium.make(ENVIRONMENT, **LQG.options() | blocks | NOISES | drawn(**values))
    plans = LQG.for_env(env).plans
    begin = env.reset(seed=0, options=LAPS[lap].reset_options())[1]["state"]
    plan = min(plans, key=lambda one: abs(one.states[0, 1] - begin[1]))
    target, found = plan.arm.tip(plan.states[:, : plan.arm.size]), []
    delay: Any = "known"  # of the first lap: the published one
    for n in range(LEARNED):
        done, delay, errors = one_lap(env, LQG.for_env(env, plans=[plan], delay=delay), lap, n)
        if done is None:
            break
        found.append(float(np.sqrt(np.mean(errors[round(SETTLED / 0.01) :] ** 2))))
        plan = learned(plan, done, target)
    env.close()
    return found + [None] * (LEARNED - len(found))


def run_arms(first: int) -> list[list[float | None]]:
    """Return the errors on some of the unknown arms, every second one on the swing lap."""
    names, laps = list(UNKNOWN_PLANT["randomisation"]), list(LAPS)
    low, high = np.array(list(UNKNOWN_PLANT["randomisation"].values())).T
    arms = low + (high - low) * np.random.default_rng(first).uniform(size=(4, len(low)))
    return [run_learning(laps[n % 2], dict(zip(names, one.tolist(), strict=True))) for n, one in enumerate(arms)]


def _trials() -> dict[str, Trial]:
    known = {f"{row}, {lap}": partial(run_learning, lap, values) for row, values in ROWS.items() for lap in LAPS}
    return {**known, **{f"unknown arms {n}": partial(run_arms, n) for n in range(ARMS // 4)}}


def rows(results: Any) -> dict[str, list[float]]:
    """Return the errors by lap of each row [mm]; the median over unknown arms, infinite where lost."""
    known = {name: laps for name, laps in results.items() if not name.startswith("unknown")}
    several = [laps for name, found in results.items() if name.startswith("unknown") for laps in found]
    errors = np.array([[np.inf if one is None else one for one in laps] for laps in [*known.values(), *several]])
    median = np.median(errors[len(known) :], axis=0)
    return {name: (1e3 * line).tolist() for name, line in zip(known, errors, strict=False)} | {
        f"{len(several)} unknown arms, median": (1e3 * median).tolist()
    }


def ilc_table(results: Any) -> str:
    """Tabulate the errors by lap."""
    lines = [[name, *(f"{e:.1f}" if np.isfinite(e) else "lost" for e in line)] for name, line in rows(results).items()]
    several = [laps for name, found in results.items() if name.startswith("unknown") for laps in found]
    lines.append(["of these lost", *(str(sum(one is None for one in lap)) for lap in zip(*several, strict=True))])
    return table(["arm, lap", *map(str, range(1, LEARNED + 1))], lines)


def ilc_picture(results: Any) -> Figure:
    """Draw the error by lap."""
    figure, axis = plt.subplots(figsize=(WIDTH, 3.6))
    lines = {name: line for name, line in rows(results).items() if not name.endswith("swing")}
    for (name, line), colour in zip(lines.items(), COLOURS, strict=False):
        axis.semilogy(range(1, LEARNED + 1), line, "o-", color=colour, label=name, markersize=4)
    axis.set(xlabel="lap", ylabel="error after 2 s, r.m.s. [mm]")
    plain_ticks(axis.yaxis)
    axis.legend()
    return figure


TEXT = "iterative learning: r.m.s. error after 2 s by lap [mm]"
STUDIES = study(__name__, "ilc", TEXT, _trials, ilc_table, ilc_picture)

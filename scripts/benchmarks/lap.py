"""The sixteen-second job: one lap of the paper's arm, by our loops, by scipy, and by the paper's own clock.

Ours and scipy's final tips are compared with a tighter solution, so that speed is told at a known error.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import gymnasium
import numpy as np
from numpy.typing import NDArray

from flexarm_baselines import IFDC
from flexarm_env import ArmParameters, FlexibleArm, LawParameters, rest_state, square
from flexarm_env.parameters import SquareParameters
from scripts.benchmarks import scipy_lap
from scripts.benchmarks.physics import LOOPS
from scripts.benchmarks.timing import Group, Ratio, Subject
from scripts.paper.cases import COLUMNS, CONTROL_PERIOD, PAPER, Study, all_cases, simulate

LAP = 16.0  # [s]
PAPER_CLOCK = {"paper, IFDC (2008)": 77.0, "paper, FLSAC (2008)": 100.0}  # [s]; end of section 4
GOAL = 3.0  # [s] for the twelve runs together
AGREEMENT = 1e-3  # [m]

HELD, ENV = "Gymnasium environment, gain held for a second", "Gymnasium environment, one step each ms"
SHARE = f"batch of {LOOPS} environments, share of one"
SCIPY = "scipy solve_ivp (LSODA, 1e-6), right-hand side in numpy"
SCIPY_COMPILED = "scipy solve_ivp (LSODA, 1e-6), right-hand side compiled by numba"
TWELVE = "twelve runs, one batch with policies"


class _Job:
    """IFDC with a collocated sensor over the first seconds of the lap."""

    def __init__(self, seconds: float) -> None:
        self.seconds = seconds
        task = SquareParameters()
        self.arm, self.law, self.path = FlexibleArm(ArmParameters.paper()), LawParameters(), square(task)
        self.start = rest_state(self.arm, self.path.table[0, 1:], task.elbow_branch)

    def environment(self, name: str, period: float, arms: int = 1) -> Subject:
        """Declare an environment, or a batch of the same one, with gain 1 as a subject."""
        options: dict[str, Any] = {"sensor": "collocated", "control_period": period, "max_episode_steps": -1}
        env: Any = gymnasium.make(PAPER, **options) if arms == 1 else gymnasium.make_vec(PAPER, arms, **options)
        action = np.ones(env.action_space.shape, dtype=np.float32)

        def work() -> None:
            for _ in range(round(self.seconds / period)):
                env.step(action)

        return Subject(name, work, arms, prepare=lambda: env.reset(seed=0))

    def scipy(self, seconds: float | None = None, **options: Any) -> NDArray[np.float64]:
        """Integrate by `solve_ivp`; return the final state."""
        return scipy_lap.solve(self.arm, self.law, self.path, self.start, seconds or self.seconds, **options)

    def errors(self) -> dict[str, float]:
        """Distance of the final true tip from that of `solve_ivp` at 1e-10 [m]: do all compute the same?"""
        env = gymnasium.make(PAPER, sensor="collocated")
        env.reset(seed=0)
        for _ in range(round(self.seconds / CONTROL_PERIOD)):
            info = env.step(np.ones(1, dtype=np.float32))[4]
        tips = {"FlexArm/Paper-v0": info["true_tip"], "solve_ivp": self.arm.tip(self.scipy()[: self.arm.size])}
        exact = self.arm.tip(self.scipy(tolerance=1e-10)[: self.arm.size])
        found = {f"final tip's error, {name} [m]": float(np.linalg.norm(tip - exact)) for name, tip in tips.items()}
        if not all(error < AGREEMENT for error in found.values()):
            raise RuntimeError(f"the programs do not compute the same: {found}")
        return found


def lap(seconds: float) -> Group:
    """Declare the group of the paper's job and the twelve runs.

    Args:
        seconds: length of the part of the lap's 16 s that is run [s]; the paper's times and the goal scale with it.
    """
    job, part = _Job(seconds), seconds / LAP
    given = {name: part * clock for name, clock in (PAPER_CLOCK | {"goal for twelve runs": GOAL}).items()}
    given["paper, twelve runs"] = 6.0 * sum(given[name] for name in PAPER_CLOCK)
    subjects = [
        job.environment(HELD, min(seconds, 1.0)),
        job.environment(ENV, CONTROL_PERIOD),
        job.environment(SHARE, CONTROL_PERIOD, LOOPS),
        Subject(SCIPY, lambda: _nothing(job.scipy())),
        Subject(
            SCIPY_COMPILED,
            lambda: _nothing(job.scipy(compiled=True)),
            prepare=lambda: job.scipy(seconds=0.01, compiled=True),
        ),
        _twelve(seconds),
    ]
    ifdc, _ = PAPER_CLOCK
    ratios = [
        Ratio(SCIPY, HELD, "scipy's time over ours, one arm, constant gain"),
        Ratio(SCIPY_COMPILED, HELD, "the same with scipy's right-hand side compiled"),
        Ratio(SCIPY, SHARE, f"scipy's time over ours, share of one in a batch of {LOOPS}"),
        Ratio(SCIPY_COMPILED, SHARE, "the same with scipy's right-hand side compiled"),
        Ratio(SCIPY, ENV, "scipy's time over ours, gain set every ms"),
        Ratio(ifdc, HELD, "paper's 77 s over ours, one arm, constant gain (machines 18 years apart)"),
        Ratio(ifdc, ENV, "paper's 77 s over ours, gain set every ms"),
        Ratio("paper, twelve runs", TWELVE, "paper's twelve runs (6 x 77 s + 6 x 100 s) over ours"),
        Ratio("goal for twelve runs", TWELVE, "goal of 3 s over the twelve runs' time (above 1: reached)"),
    ]
    title = f"The job: {seconds:g} s of the paper's arm on its lap, law in continuous time"
    return Group(
        "lap", title, "s", "job", subjects, ratios, given, {"seconds": seconds} | job.errors(), warm=False, share=0.5
    )


def _nothing(_: Any) -> None:
    """Return no parts."""


def _twelve(seconds: float) -> Subject:
    study, column, cases = Study(), COLUMNS["paper"], all_cases()
    ifdc, flsac = IFDC(), study.fuzzy(study.arm(column))
    policies = [flsac if case.controller == "flsac" else ifdc for case in cases]
    options = [case.options | {"gain_limit": study.gain(case)} for case in cases]

    def run(steps: int) -> Callable[[], None]:
        """So many control periods of the twelve runs."""
        return lambda: _nothing(simulate(study, column, options, policies, steps=steps))

    return Subject(TWELVE, run(round(seconds / CONTROL_PERIOD)), prepare=run(2))

"""A small arm, a short way there and back, a plan along it, and a plant whose tip's readings are late."""

from collections.abc import Iterator
from functools import cache
from typing import Any

import numpy as np

from flexarm_baselines.optimal import Plan
from flexarm_baselines.task import Task
from flexarm_env import ArmParameters, FlexibleArm
from flexarm_env.physics.paths import ReferencePath

ARM = FlexibleArm(ArmParameters.linear(modes_per_link=1))
PERIODS, SIZE, DELAY = 40, 8, 0.0234
START = np.array([0.3, 0.9, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])
LIMITS = (60.0, 20.0)
PLACES = {"joint_angles": (0, 2), "joint_rates": (2, 4), "sensed_position": (4, 6), "lap_phase": (6, 8)}
BLOCKS = {name: slice(*ends) for name, ends in PLACES.items()}
BLOCKS |= {"modal_coordinates": slice(8, 10), "modal_rates": slice(10, 12), "state": slice(12, 20)}


@cache
def plan(periods: int = PERIODS) -> Plan:
    """Return a run that is no optimum; its reference is another, there and back."""
    time = 0.01 * np.arange(periods)
    torques = np.stack([20.0 * np.sin(9.0 * time), -5.0 * np.sin(12.0 * time)], axis=1)
    run = ARM.rollout(START, torques)
    return Plan(ARM.parameters, run.states, torques, task(periods).reference, LIMITS, 0.01, 1e-3)


@cache
def task(periods: int = PERIODS) -> Task:
    away, lap = ARM.tip(START[:4]), 0.01 * periods
    path = ReferencePath([[0.0, *away], [0.5 * lap, *(away - 0.1)], [lap, *away]])
    return Task(ARM.parameters, path, torque_limit=LIMITS, delay=DELAY, blocks=BLOCKS, scale=np.ones(20))


class Plant:
    """Arms whose tip's readings are late, observed as in an environment."""

    def __init__(self, states: np.ndarray, delay: float = DELAY, periods: int = PERIODS, **quantities: float) -> None:
        self.states, self.delay, self.quantities, self.period, self.periods = states, delay, quantities, 0, periods
        self.past = [states] * 5  # at each period's beginning, the newest first
        self.torques = [np.zeros((len(states), 2))] * 4

    def observe(self) -> np.ndarray:
        angle = 2.0 * np.pi * self.period / self.periods
        phase = np.tile([np.cos(angle), np.sin(angle)], (len(self.states), 1))
        joints = self.states[:, [0, 1, 4, 5]]
        return np.hstack([joints, self.late_tip(), phase, self.states[:, [2, 3, 6, 7]], self.states])

    def late_tip(self) -> np.ndarray:
        begun = int(np.ceil(self.delay / 0.01))
        part = 0.01 * begun - self.delay
        states = self.past[begun]
        if self.period >= begun and part > 1e-9:
            states = ARM.step(states, self.torques[begun - 1], part, step=part / 10, **self.quantities)
        return ARM.tip(states[:, :4])

    def step(self, action: np.ndarray) -> None:
        torque = action.astype(np.float64) * LIMITS
        self.states = ARM.step(self.states, torque, 0.01, **self.quantities)
        self.past, self.torques = [self.states, *self.past[:4]], [torque, *self.torques[:3]]
        self.period += 1

    def driven(self, controller: Any, periods: int) -> Iterator[tuple[np.ndarray, Any]]:
        """Yield action and state of each control period under a controller."""
        state = None
        for _ in range(periods):
            action, state = controller.predict(self.observe(), state)
            self.step(action)
            yield action, state


def off_plan(controller: Any, plant: Plant, planned: Plan) -> np.ndarray:
    """Run a lap but for its last period; return how far the arms are off the plan at each instant."""
    states = [plant.states for _ in plant.driven(controller, len(planned.torques) - 1)]
    return np.array(states) - planned.states[1:-1, None]

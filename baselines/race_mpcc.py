"""`RaceMPCC`: model predictive contouring control of a race, whose inputs are the torques and the progress.

See `predictive.contouring` for prediction, cost and sources.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from flexarm_baselines.arrays import Floats, chosen_rows, is_sound
from flexarm_baselines.controller import Memory, Seen
from flexarm_baselines.lqg.race_paced import Paced, Placed
from flexarm_baselines.optimal.plan import Plan
from flexarm_baselines.predictive.contouring import ContouringIteration, Prediction
from flexarm_baselines.predictive.controller import DOUBTFUL, NMPC, UNKNOWN
from flexarm_baselines.predictive.iteration import Instant
from flexarm_baselines.task import Task
from flexarm_env.simulation.feedback import Rollout
from flexarm_env.validation import number

HORIZON = 0.5  # [s]; at twice the price below, 0.3 s loses 21 of 32 unknown arms, and 0.5 s one
PRICE = 0.0025  # [m^2]; worth of a period of progress: the tip's squared distance that costs as much in a period


class RaceMPCC(Paced, NMPC):
    """Contouring control of the state, payload, stiffness and delay that a Kalman filter estimates.

    Attributes:
        iteration: see `ContouringIteration`.
    """

    def __init__(self, task: Task, plans: Sequence[Plan], price: float = PRICE, **design: Any) -> None:
        """Design filter and prediction.

        Args:
            task: see `Task`.
            plans: the plan of the race.
            price: worth of a period of progress, as the tip's squared distance that costs as much in a period [m^2].
            **design: see `NMPC`; by default the filter estimates `UNKNOWN`, assumes the noise `DOUBTFUL`, and
                predictions last `HORIZON`. `iterations` and `damping` must be those defaults.

        Raises:
            ValueError: for other `iterations` or `damping`, or as in `NMPC`.
        """
        for name, only in (("iterations", 1), ("damping", 0.0)):
            if design.get(name, only) != only:
                raise ValueError(f"{name} = {design[name]!r}: must be {only}, contouring control takes nothing else")
        settings: dict[str, Any] = {"unknown": UNKNOWN, "noise": DOUBTFUL, "horizon": HORIZON, **design}
        super().__init__(task, plans=plans, **settings)
        own = self.iteration
        limits = float(own.limits[0]), float(own.limits[1])
        self.iteration: ContouringIteration = ContouringIteration(
            own.model, own.runs, own.horizon, limits, own.period, own.step, own.damping
        )
        self.iteration.price = number("price", price, "m^2", least=0.0)

    def start(self, seen: Seen) -> Memory:
        """Begin the plan, with the reference and the motors at rest."""
        _, before, states, torques, *belief = super().start(seen)
        instants = np.tile(np.arange(self.iteration.horizon + 1.0), (len(seen), 1))
        return (*np.zeros((2, len(seen))), before, states, torques, instants, *belief)

    def torque(self, seen: Seen, memory: Memory) -> tuple[Floats, Memory]:
        """Return torques and the speed of the reference as a share of the largest, Shape (n, 3), and the memory."""
        way, speed, before, states, torques, instants, *belief = memory
        placed, run = Placed(seen.task, seen.observations), np.zeros(len(seen), dtype=np.int64)
        placed.instants = instants[:, 0]
        believed, quantities, after = self.update(placed, tuple(belief), run)
        believed = chosen_rows(is_sound(believed), believed, states[:, 0])  # without numbers: as predicted
        now = Instant(run, self.iteration.place(instants[:, 0]), believed, before, quantities)
        prediction = self.iteration.contoured(Prediction(states, torques, instants), now)
        instants = prediction.instants
        torque = prediction.torques[:, 0].copy()
        share, way, speed = self.led(instants[:, 1], way, speed)
        last = now._replace(period=self.iteration.place(instants[:, -1]) - self.iteration.horizon)
        run_on = self.iteration.shifted(Rollout(prediction.states, prediction.torques), last)
        instants = np.column_stack([instants[:, 1:], 2.0 * instants[:, -1] - instants[:, -2]])
        return np.column_stack([torque, share]), (way, speed, torque, *run_on, instants, *self.advance(after, torque))

"""Iterative learning: the plan of the next lap is what the arm did on the last one, corrected for its error.

Norm-optimal iterative learning control minimises the error that the model predicts for the next lap and the change of
the torques. Its solution is a Riccati recursion: that of the regulator, with the last lap's error as a linear cost.
Source: Amann, Owens and Rogers, *Iterative learning control for discrete-time systems with exponential rate of
convergence*, IEE Proc. Control Theory and Applications 143, 1996. The feedback acts on what differs from lap to lap.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from flexarm_baselines.arrays import Floats
from flexarm_baselines.optimal import LinearQuadratic, Plan, RegulatorWeights
from flexarm_env.simulation.arm import FlexibleArm
from flexarm_env.validation import finite_array

# Errors of 10 mm are worth changes of the torques by 6 and 2 N m, as in `GOOD`; speeds count little: none is measured.
LEARNING = RegulatorWeights(tip=0.01, speed=3.0, torque=(6.0, 2.0))


class Lap(NamedTuple):
    """What is known after a lap of n periods.

    Attributes:
        states: that the filter estimated. Shape (n + 1, s).
        torques: that were commanded [N m]. Shape (n, 2).
        tip: where the sensor saw the tip at each instant [m]. Shape (n + 1, 2).
    """

    states: Floats
    torques: Floats
    tip: Floats


def learned(plan: Plan, lap: Lap, target: Floats, weights: RegulatorWeights = LEARNING) -> Plan:
    """Return the plan of the next lap.

    Args:
        plan: of the lap that is over; its arm is the model.
        lap: what the arm did.
        target: where the tip should have been [m]. Shape (n + 1, 2).
        weights: what an error is worth in torques.
    """
    count, size = plan.torques.shape[0], plan.states.shape[1]
    for name, shape in (("states", (count + 1, size)), ("torques", (count, 2)), ("tip", (count + 1, 2))):
        finite_array(name, getattr(lap, name), shape)
    done = replace(plan, states=lap.states, torques=lap.torques)
    problem = LinearQuadratic.along(done, weights, FlexibleArm(plan.parameters))
    error = (lap.tip - finite_array("target", target, (count + 1, 2))) / weights.tip**2
    forward, gains = problem.improved(np.einsum("tij,ti->tj", problem.tip, error))
    change, limits = np.zeros_like(lap.states), np.asarray(plan.limits)
    torques = lap.torques.copy()
    for k in range(count):
        wanted = lap.torques[k] + forward[k] + gains[k] @ change[k]
        torques[k] = wanted.clip(-limits, limits)
        change[k + 1] = problem.by_state[k] @ change[k] + problem.by_torque[k] @ (torques[k] - lap.torques[k])
    return replace(plan, states=lap.states + change, torques=torques)

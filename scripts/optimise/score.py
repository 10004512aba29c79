"""What a plan scores in the environment, as any policy is scored."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

import gymnasium
import numpy as np

import flexarm_env  # noqa: F401  (registers the environments)
from flexarm_baselines.optimal import AGGRESSIVE, GOOD, Plan, PlanRegulator
from flexarm_env.laps import LAPS
from flexarm_env.metrics import summary

# What is run under the regulators, by its difference from the plan's arm.
CASES: dict[str, dict[str, float]] = {
    "as planned": {},
    "frequencies -10 %": {"stiffness": 0.81},
    "frequencies +10 %": {"stiffness": 1.21},
    "payload 0.1 kg": {"payload_mass": 0.1},
    "payload 0.5 kg": {"payload_mass": 0.5},
    "payload 1 kg": {"payload_mass": 1.0},
}
REGULATORS = {"good": GOOD, "aggressive": AGGRESSIVE}
FIGURES = ("true_tip_rms", "true_tip_rms_after_2s", "true_tip_max", "elbow_changes", "vibration")


def score(plan: Plan, lap: str) -> dict[str, Any]:
    """Run a plan through `FlexArm/Square-v0` under feedback of the true state, and return the figures of its lap.

    An environment's actions are of single precision, and the arm's motion along a lap is so sensitive that torques
    rounded to that leave the plan after some seconds without feedback.
    """
    env = gymnasium.make("FlexArm/Square-v0", arm=asdict(plan.parameters), torque_limit=plan.limits)
    regulator, time = PlanRegulator(plan), plan.time.tolist()
    _, info = env.reset(options=LAPS[lap].reset_options())
    states, torques, references = [info["state"]], [], [info["reference"]]
    for instant in time[:-1]:
        torque = regulator.torque(instant, states[-1])
        _, _, terminated, _, info = env.step((torque / plan.limits).astype(np.float32))
        if terminated:
            raise RuntimeError(f"the plan of the {lap} lap ends the episode after {info['time']:.2f} s")
        states.append(info["state"])
        torques.append(info["torque"])
        references.append(info["reference"])
    run = plan.arm.record(
        plan.time, np.array(states), np.array([*torques, torques[-1]]), reference=np.array(references)
    )
    figures = summary(run)
    return {name: figures[name] for name in FIGURES} | efforts(plan)


def efforts(plan: Plan) -> dict[str, Any]:
    """Return r.m.s. torques and their r.m.s. changes from period to period [N m]."""
    changes = np.diff(plan.torques, axis=0)
    return {
        "torque_rms": np.sqrt(np.mean(plan.torques**2, axis=0)).tolist(),
        "torque_change_rms": np.sqrt(np.mean(changes**2, axis=0)).tolist(),
    }


def regulated(plan: Plan) -> dict[str, dict[str, dict[str, float]]]:
    """Run arms that are not the planned one under regulators that know their true state, all at once.

    Returns:
        r.m.s. distance over the lap and after 2 s [m] by regulator and case.
    """
    nominal = {"stiffness": 1.0, "payload_mass": plan.parameters.payload_mass}
    quantities: dict[str, Any] = {
        name: [case.get(name, value) for case in CASES.values()] for name, value in nominal.items()
    }
    found: dict[str, dict[str, dict[str, float]]] = {}
    for name, weights in REGULATORS.items():
        states = PlanRegulator(plan, weights).rollout(**quantities).states
        squares = np.sum((plan.arm.tip(states[..., : plan.arm.size]) - plan.reference) ** 2, axis=-1)
        errors = [np.sqrt(np.mean(part, axis=-1)) for part in (squares, squares[:, plan.time >= 2.0])]
        found[name] = {
            case: {"true_tip_rms": float(whole), "true_tip_rms_after_2s": float(late)}
            for case, whole, late in zip(CASES, *errors, strict=True)
        }
    return found

"""The design of LQG for a set of plants: its measure of decay by its parts, and the shipped design on other plants."""

from dataclasses import replace

import numpy as np
import pytest

from flexarm_baselines.lqg import LQG, QUICK
from flexarm_baselines.optimal import GOOD
from scripts.control import robust
from scripts.control.robust import FOUND, Design, decay, decays, nominal_task, plants

NOMINAL = {"payload_mass": 0.0, "stiffness": 1.0, "damping": 0.01, "actuation_delay": 0.0}


@pytest.mark.parametrize("scale", [0.5, 2.0])
def test_decay_on_the_model_is_that_of_the_slower_of_filter_and_regulator(
    monkeypatch: pytest.MonkeyPatch, scale: float
) -> None:
    """Where the plant is the model, errors of the estimate and deviations under the true state go on by themselves."""
    controller = LQG(nominal_task())
    gain = scale * controller.regulator.gain  # twice the gain is too much for torques that are held
    controller.regulator = replace(controller.regulator, gain=gain)
    box = {**NOMINAL, "delay": controller.task.delay}
    monkeypatch.setattr(robust, "BOX", {name: (value, value) for name, value in box.items()})
    (plant,) = plants(controller.task, controller.plans, 1)
    parts = {"state": np.ones(plant.matrix.shape[-1]), "error": np.ones(plant.matrix.shape[-1])}
    logs = dict.fromkeys(parts, 0.0)
    known = controller.filter.matrix.shape[-1]
    for k in range(robust.FIRST, robust.LAST):
        matrix, by_torque = plant.matrix[0, k], plant.by_torque[0, k]
        parts["state"] = matrix @ parts["state"] + by_torque @ gain[0, k, :, :known] @ parts["state"][:known]
        parts["error"] = matrix @ (parts["error"] - controller.filter.gain[0, k] @ parts["error"][plant.rows])
        for name, part in parts.items():
            logs[name] += np.log(np.linalg.norm(part))
            parts[name] = part / np.linalg.norm(part)
    slower = -max(logs.values()) / (0.01 * (robust.LAST - robust.FIRST))
    assert decay(controller, plant, 0) == pytest.approx(slower, abs=0.2)  # a transient of a factor of five in 8 s
    assert (slower > 0.0) == (scale < 1.0)


def test_the_shipped_design_damps_deviations_on_other_plants_of_the_box() -> None:
    task = nominal_task()
    shipped, quick = LQG(task), LQG(task, noise=QUICK, weights=GOOD)
    others = plants(task, shipped.plans, 16, seed=1)
    assert decays(shipped, others).min() > 0.0
    assert np.mean(decays(quick, others).min(axis=1) < 0.0) > 0.3


def test_the_shipped_design_is_the_one_that_was_found_in_round_numbers() -> None:
    found, shipped = FOUND.arguments(), {"noise": robust.NOISE, "weights": robust.WEIGHTS}
    for name in ("joint_angle", "joint_rate", "torque"):
        assert getattr(shipped["noise"], name) == pytest.approx(getattr(found["noise"], name), rel=0.15)
    assert shipped["weights"].speed == pytest.approx(found["weights"].speed, rel=0.15)
    assert Design().towards(FOUND, 1.0) == pytest.approx(FOUND)

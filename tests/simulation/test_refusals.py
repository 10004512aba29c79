"""What `FlexibleArm` refuses: one table of all its methods (what counts as an array or number: test_parameters)."""

from typing import Any

import numpy as np
import pytest

from flexarm_env import ArmParameters, FlexibleArm
from tests.support.refusals import label, refuses

ARM = FlexibleArm(ArmParameters.linear(modes_per_link=1))
Q, REST, N = np.zeros(4), np.zeros(8), 5
STEP: dict[str, Any] = {"state": REST, "torque": (0.0, 0.0)}
# Arguments of a call that is right.
GOOD: dict[str, dict[str, Any]] = {
    "mass_matrix": {"q": Q},
    "velocity_forces": {"q": Q, "rates": Q},
    "acceleration": STEP,
    "energy": {"state": REST},
    "position": {"q": Q, "link": 1, "s": 1.0},
    "velocity": {"state": REST, "link": 2, "s": 1.0},
    "point_jacobian": {"q": Q, "link": 2, "s": 1.0},
    "linearise": STEP,
    "output_jacobians": {"state": REST},
    "record": {"time": np.arange(3.0), "state": np.zeros((3, 8)), "torque": np.zeros((3, 2))},
    "simulate": {"initial_state": REST, "torque": None, "duration": 0.01, "step": 1e-3},
    "step": STEP,
    "step_jacobians": STEP,
    "step_gradients": STEP | {"weights": REST},
    "rollout": {"state": REST, "torques": np.zeros((N, 2))},
}
STEPS = "step step_jacobians step_gradients"
BAD: list[tuple[str, dict[str, Any], tuple[str, ...]]] = [
    ("mass_matrix", {"q": REST}, ("q: must have shape (..., 4), got (8,)",)),
    ("velocity_forces", {"rates": [0.0] * 3 + [np.inf]}, ("rates[3] = inf",)),
    ("acceleration energy velocity linearise output_jacobians", {"state": [np.nan] * 8}, ("state[0] = nan",)),
    (f"acceleration energy linearise {STEPS}", {"state": [1e13] * 8}, ("state[0] = 1", "at most 1e+12")),
    ("acceleration linearise", {"torque": (1.0, np.nan)}, ("torque[1] = nan",)),
    ("velocity_forces", {"q": np.zeros((3, 4)), "rates": np.zeros((2, 4))}, ("broadcast", "q (3,), rates (2,)")),
    ("acceleration", {"state": np.zeros((3, 8)), "torque": np.zeros((2, 2))}, ("broadcast", "state (3,), torque (2,)")),
    ("position point_jacobian", {"q": np.zeros((3, 4)), "s": [1.0, 2.0]}, ("broadcast", "coordinates (3,), s (2,)")),
    ("velocity", {"state": np.zeros((3, 8)), "s": [1.0, 2.0]}, ("broadcast", "coordinates (3,), s (2,)")),
    ("acceleration", {"torque": (1e300, 0.0)}, ("torque[0] = 1e+300", "at most 1e+12")),
    ("linearise", {"state": np.zeros((2, 8))}, ("state: must have shape (8,)",)),
    ("position velocity point_jacobian", {"link": 3}, ("link = 3", "from 1 to 2")),
    ("position point_jacobian", {"q": REST}, ("q: must have shape (..., 4)",)),
    ("position velocity point_jacobian", {"s": 4.6}, ("s = 4.6", "0 to 4.5")),
    ("position velocity point_jacobian", {"s": np.nan}, ("s = nan", "0 to 4.5")),
    ("position", {"s": -0.1}, ("s = -0.1", "0 to 4.5")),
    ("position", {"s": "x"}, ("s = 'x'", "real numbers")),
    ("output_jacobians", {"sensor_position": 5.0}, ("sensor_position = 5.0", "<= 4.5")),
    ("record", {"time": [], "state": np.zeros((0, 8)), "torque": np.zeros((0, 2))}, ("time: must hold an instant",)),
    ("record", {"state": []}, ("state: must have shape (n, 8), got (0,)",)),
    ("record", {"reward": np.zeros(2)}, ("reward: has shape (2,), time has 3 instants",)),
    ("simulate", {"initial_state": np.zeros((1, 8))}, ("initial_state", "(8,)")),
    ("simulate", {"initial_state": [0.0] * 7 + [np.nan]}, ("initial_state[7] = nan", "finite")),
    ("simulate", {"torque": np.zeros((9, 2))}, ("torque", "(10, 2)", "(9, 2)")),
    ("simulate", {"torque": np.full((10, 2), np.inf)}, ("torque[0, 0] = inf", "finite")),
    ("simulate", {"torque": lambda time, state: 1.0}, ("torque(time=0, state)", "(2,)")),
    (
        "simulate",
        {"torque": lambda t, _: (0.0, 0.0 if t < 0.0042 else np.nan)},
        ("torque(time=0.0045, state)[1] = nan",),
    ),
    ("simulate", {"duration": 0.0105}, ("duration = 0.0105", "whole number of steps of 0.001 s")),
    ("simulate", {"duration": 0.0}, ("duration = 0.0", "> 0.0")),
    ("simulate", {"duration": 1.7e308}, ("duration = 1.7e+308", "at most 10000000 steps")),
    ("simulate", {"step": np.nan}, ("step = nan", "finite")),
    ("simulate", {"step": 1e300, "duration": 1e300, "substeps": "auto"}, ("step = 1e+300 s", "substeps")),
    ("simulate", {"step": 0.1, "duration": 0.1, "substeps": 1}, ("step = 0.1 s in 1", "at most", "'auto', here ")),
    ("simulate", {"substeps": 0}, ("substeps = 0", "an integer from 1 to")),
    ("simulate", {"substeps": "many"}, ("substeps = 'many'", "integer >= 1 or 'auto'")),
    (f"{STEPS} rollout", {"state": np.zeros(7)}, ("state", "(..., 8)", "(7,)")),
    (STEPS, {"torque": np.zeros((2, 3))}, ("torque", "(..., 2)", "(2, 3)")),
    (STEPS, {"torque": (np.inf, 0.0)}, ("torque[0] = inf", "finite")),
    (STEPS, {"state": np.zeros((3, 8)), "torque": np.zeros((2, 2))}, ("broadcast", "state (3,)", "torque (2,)")),
    ("step_gradients", {"weights": np.ones(7)}, ("weights: must have shape (..., 8), got (7,)",)),
    ("step_gradients", {"state": np.zeros((2, 8)), "weights": np.ones((3, 8))}, ("broadcast", "weights (3,)")),
    (f"{STEPS} rollout", {"period": 0.0105}, ("period = 0.0105", "whole number of steps of 0.001 s")),
    (f"{STEPS} rollout", {"period": -0.01}, ("period = -0.01", "> 0")),
    (f"{STEPS} rollout", {"period": 1.0, "step": 0.1}, ("step = 0.1", "fastest mode", "at most")),
    (STEPS, {"step": 0.01, "period": 0.1, "stiffness": [1.0, 100.0]}, ("step = 0.01", "fastest mode")),
    (f"{STEPS} rollout", {"payload_mass": -0.1}, ("payload_mass = -0.1", "from 0 to 1000 [kg]")),
    (STEPS, {"stiffness": [1.0, np.nan]}, ("stiffness = nan", "from 0.001 to 1000")),
    (STEPS, {"damping": [[0.1], [2.0]]}, ("damping = 2.0", "from 0 to 1")),
    ("rollout", {"torques": np.zeros(2)}, ("torques", "(..., n, 2)", "(2,)")),
    ("rollout", {"torques": np.zeros((0, 2))}, ("torques", "(..., n, 2)", "(0, 2)")),
    ("rollout", {"torques": np.full((N, 2), np.nan)}, ("torques[0, 0] = nan", "finite")),
    ("rollout", {"gains": np.zeros((N, 2, 8))}, ("references = None", "gains")),
    ("rollout", {"references": np.zeros((N, 8))}, ("gains = None", "references")),
    ("rollout", {"gains": np.zeros((2, 2, 8)), "references": np.zeros((N, 8))}, ("gains", "(..., 5, 2, 8)")),
    ("rollout", {"torque_gains": np.zeros((N, 2))}, ("torque_gains", "(..., 5, 2, 2)", "(5, 2)")),
    ("rollout", {"torque_before": (1.0,)}, ("torque_before", "(..., 2)", "(1,)")),
    ("rollout", {"limits": (150.0, 0.0)}, ("limits", "> 0")),
    ("rollout", {"state": np.zeros((3, 8)), "torques": np.zeros((2, N, 2))}, ("broadcast", "torques (2,)")),
]
CALLS = [(method, changes, words) for methods, changes, words in BAD for method in methods.split()]


@pytest.mark.parametrize(("method", "changes", "words"), CALLS, ids=label)
def test_bad_arguments_are_refused(method: str, changes: dict[str, Any], words: tuple[str, ...]) -> None:
    with refuses(ValueError, *words):
        getattr(ARM, method)(**GOOD[method] | changes)


def test_other_types_are_refused_and_a_functions_own_errors_pass() -> None:
    for method, name, value in (
        ("position", "link", "1"),
        ("simulate", "duration", "1"),
        ("simulate", "substeps", 1.5),
    ):
        with refuses(TypeError, f"{name} = {value!r}"):
            getattr(ARM, method)(**GOOD[method] | {name: value})
    with refuses(TypeError, "parameters = ", "ArmParameters"):
        FlexibleArm({"modes_per_link": 2})  # type: ignore[arg-type]
    with refuses(ZeroDivisionError):
        ARM.simulate(REST, lambda time, state: (0.0, 1 // 0), 0.01)

"""Fields of parameters, configurations, controllers, plans and policies: one to three of them allowed or garbage."""

from collections.abc import Callable
from dataclasses import fields, replace
from functools import cache
from typing import Any, NamedTuple

import numpy as np
import pytest
from hypothesis import event, given
from hypothesis import strategies as st

from flexarm_agents import DAggerConfig, FOPGConfig, PPOConfig, SACConfig
from flexarm_agents.policies.encoders import PastReadings
from flexarm_agents.policies.load import load_policy
from flexarm_baselines.joint_space.tracking import JointFeedback, Shape
from flexarm_baselines.observers.noise import NoiseModel
from flexarm_baselines.optimal.linear_quadratic import RegulatorWeights
from flexarm_baselines.optimal.plan import load_plan
from flexarm_baselines.optimal.problem import TrackingProblem
from flexarm_baselines.paper_law.flsac import FLSAC
from flexarm_baselines.paper_law.ifdc import IFDC
from flexarm_env import ArmParameters, LawParameters, SensorParameters, SquareParameters
from tests.hardening.strategies import GARBAGE, Contrary, cases, check_refusal, inside


class Subject(NamedTuple):
    """What is made of fields."""

    make: Callable[..., Any]  # makes it of the fields that are changed
    # names of the fields, with the strategies of sensible values; None: garbage only
    fields: dict[str, st.SearchStrategy[Any] | None]


def _declared(kind: Any, make: Callable[..., Any] | None = None) -> Subject:
    """Return the subject of a dataclass; declarations say what its fields may be, where there are any."""
    found = {one.name: inside(one.metadata.get("allowed")) for one in fields(kind) if one.init}
    return Subject(make or kind, {name: None if one.is_empty else one for name, one in found.items()})


def _of(example: Any) -> Subject:
    """Return the subject of a dataclass that needs arguments: an example with other fields."""
    return _declared(type(example), lambda **changes: replace(example, **changes))


@cache
def subjects() -> dict[str, Subject]:
    plan, policy = load_plan("default_plain"), load_policy("square").policy
    arm = plan.arm
    trained = PPOConfig, SACConfig, DAggerConfig, FOPGConfig
    others = JointFeedback, Shape, RegulatorWeights, NoiseModel, IFDC
    kinds = ArmParameters, SensorParameters, LawParameters, SquareParameters, *trained, *others
    found = {kind.__name__: _declared(kind) for kind in kinds}
    examples = (
        plan,
        policy,
        PastReadings(4, (1, 3), (0, 2)),
        TrackingProblem(arm, plan.states[0], plan.reference[:20], plan.limits),
        FLSAC(slice(0, 2), np.ones(1)),
    )
    return found | {type(one).__name__: _of(one) for one in examples}


@st.composite
def drawn(draw: st.DrawFn) -> tuple[str, dict[str, Any]]:
    name = draw(st.sampled_from(sorted(subjects())))
    own, values = subjects()[name].fields, {}
    for one in draw(st.lists(st.sampled_from(sorted(own)), min_size=1, max_size=3, unique=True)):
        sensible = own[one] if draw(st.booleans()) else None
        values[one] = draw(st.sampled_from(GARBAGE) if sensible is None else sensible)
    return name, values


def is_made(name: str, values: dict[str, Any]) -> bool:
    """Make something of fields; return whether they are taken."""
    subject = subjects()[name]
    try:
        subject.make(**values)
    except Exception as error:
        check_refusal(error, [*values, *subject.fields, "sensor"])
        return False
    return True


@cases(60, 20_000)
@given(drawn())
def test_fields_are_taken_or_refused_by_name(case: tuple[str, dict[str, Any]]) -> None:
    event("made" if is_made(*case) else "refused")


FOUND: list[tuple[str, dict[str, Any]]] = [  # by campaigns
    ("DAggerConfig", {"arms": None}),
    ("FOPGConfig", {"critic_epochs": np.zeros(0)}),
    ("PPOConfig", {"batch": 10**5000}),
    ("PastReadings", {"lags": True}),
    ("PastReadings", {"remembered": 1j}),
    ("NetworkPolicy", {"weights": None}),
    ("NetworkPolicy", {"biases": 0.5}),
    ("NetworkPolicy", {"encoder": {}}),
    ("TrackingProblem", {"tip_weights": Contrary()}),
    ("FLSAC", {"tip_weights": Contrary()}),
]


@pytest.mark.parametrize(("name", "values"), FOUND, ids=[f"{name} {next(iter(values))}" for name, values in FOUND])
def test_bad_fields_are_refused_by_name(name: str, values: dict[str, Any]) -> None:
    assert not is_made(name, values)

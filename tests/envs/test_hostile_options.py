"""Any options at all: taken, and then the environment runs; or refused by name, soon, and with no warning."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable
from dataclasses import fields
from decimal import Decimal
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from flexarm_env import ArmParameters, FlexibleArm, LawParameters, SensorParameters, SquareParameters
from flexarm_env.actions import MODES
from flexarm_env.allowed import Flag, Integer, Number, OneOf, Optional, Pair
from flexarm_env.envs.blocks import BLOCKS
from flexarm_env.envs.settings import Settings
from flexarm_env.envs.single import FlexArmEnv
from flexarm_env.episode.reward import TERMS
from flexarm_env.kernels.entries import DRAWN
from flexarm_env.physics.paths import ReferencePath, inverse_kinematics, square, way_points

LONGEST = 5.0  # [s], for what an environment does below on a busy machine, nothing to be compiled


class Contrary:
    """Refuses to be shown or converted."""

    def __repr__(self) -> str:
        raise RuntimeError("no repr")

    def __float__(self) -> float:
        raise RuntimeError("no float")

    def __array__(self, *arguments: Any, **named: Any) -> Any:
        raise RuntimeError("no array")


GARBAGE: list[Any] = [
    *(None, True, False, 0, -1, 3, 0.0, -0.0, 1.5, -1.0, 1e-320, 1e-12, 1e12, 1e300, -1e308, math.nan, math.inf, 1j),
    *(
        10**400,
        10**5000,
        Fraction(1, 3),
        Decimal("0.1"),
        "",
        "x",
        "square",
        "\x00",
        "x" * 100_000,
        b"ab",
        bytearray(b"ab"),
    ),
    *(memoryview(b"ab"), [], (), [1.0], (1.0, 2.0), [1.0, 2.0, 3.0], [[1.0, 2.0], [3.0, 4.0]], [None, 1.0], ["x", "y"]),
    *(
        {},
        {"x": 1.0},
        {1: 2},
        {"effort": 1.0},
        {"noise": (0.0, 1.0)},
        {1.0, 2.0},
        frozenset((1.0, 2.0)),
        range(2),
        object(),
    ),
    *(
        np.float32(0.5),
        np.int8(1),
        np.bool_(True),
        np.array(0.5),
        np.array(True),
        np.array("true"),
        np.zeros(0),
        np.ones(2),
    ),
    *(
        np.ones((2, 2)),
        np.array([1, 2]),
        np.array(["a", "b"]),
        np.array([1.0, None]),
        np.datetime64("2026-01-01"),
        np.ones(2) * 1j,
    ),
    *(
        np.longdouble("1e4000"),
        np.float16(0.1),
        np.array([np.nan, 1.0]),
        np.zeros((0, 2)),
        iter((1.0, 2.0)),
        Contrary(),
        len,
        int,
    ),
]


def numbers(least: float, most: float) -> st.SearchStrategy[float]:
    """Draw the bounds, what is just beyond them, and magnitudes evenly between them."""
    edges = [least, most, float(np.nextafter(least, -np.inf)), float(np.nextafter(most, np.inf))]
    low = max(least, 1e-9)
    exponents = st.floats(math.log10(low), math.log10(most))
    return st.sampled_from(edges) | exponents.map(lambda x: min(max(10.0**x, least), most))


def inside(allowed: Any) -> st.SearchStrategy[Any]:
    """Values that a declaration allows by itself, or nearly."""
    if isinstance(allowed, Optional):
        return st.none() | inside(allowed.other)
    if isinstance(allowed, Pair):
        one = numbers(allowed.least, allowed.most)
        return st.tuples(one, one)
    if isinstance(allowed, Number):
        return numbers(allowed.least, allowed.most)
    if isinstance(allowed, Integer):
        return st.integers(allowed.least, allowed.most)
    if isinstance(allowed, OneOf):
        return st.sampled_from(allowed.names)
    if isinstance(allowed, Flag):
        return st.booleans()
    return st.nothing()


def declared_arms(*left_out: str) -> st.SearchStrategy[dict[str, Any]]:
    every = {one.name: inside(one.metadata["allowed"]) for one in fields(ArmParameters) if one.name not in left_out}
    return st.fixed_dictionaries({}, optional=every)


def ranges() -> st.SearchStrategy[dict[str, Any]]:
    two = st.tuples(numbers(1e-6, 10.0), numbers(1e-6, 10.0)).map(sorted)
    return st.dictionaries(st.sampled_from(sorted(DRAWN)), two, max_size=3)


# Options whose declaration is a function.
CUSTOM: dict[str, st.SearchStrategy[Any]] = {
    "arm": st.sampled_from(["default", "paper"]) | declared_arms("modes_per_link", "kinematics"),  # few kernels
    "action_mode": st.sampled_from([name for name in MODES if name != "torque_rate"]),  # few kernels
    "delay": numbers(0.0, 10.0) | st.tuples(numbers(0.0, 10.0), numbers(0.0, 10.0)),
    "hold": numbers(1e-6, 10.0),
    "observation": st.lists(st.sampled_from(sorted(BLOCKS)), min_size=1, max_size=5, unique=True),
    "previews": st.lists(numbers(1e-6, 1e5), max_size=4),
    "reference": st.sampled_from(["square", "circle", "line", "figure_eight", "moves", "waypoints"]),
    "waypoints": st.lists(st.tuples(numbers(1e-3, 1e6), numbers(1e-3, 8.0)), max_size=4),
    "randomisation": ranges(),
    "reward_weights": st.dictionaries(st.sampled_from(sorted(TERMS)), numbers(0.0, 1e12), min_size=1, max_size=3),
}
SENSIBLE = {one.name: CUSTOM.get(one.name, inside(one.metadata["allowed"])) for one in fields(Settings)}
SETTINGS_FIELDS = {one.name: one.metadata["allowed"] for one in fields(Settings)}
NAMES = sorted(SENSIBLE)


@st.composite
def any_options(draw: st.DrawFn, garbage: bool = True) -> dict[str, Any]:
    """Draw a few options: allowed by themselves, at the edges of it, or none of it."""
    chosen = draw(st.lists(st.sampled_from(NAMES), min_size=1, max_size=4, unique=True))
    bad = draw(st.sampled_from([None, *chosen])) if garbage else None
    return {name: draw(st.sampled_from(GARBAGE) if name == bad else SENSIBLE[name]) for name in chosen}


def refusal_names_it(error: Exception, names: Iterable[str]) -> None:
    """Check that the message is short and begins with one of the names, or an option's or an arm's field."""
    text = str(error)
    assert type(error) in (TypeError, ValueError), repr(error)
    assert len(text) < 2000
    # one that was not given may be refused for one that was
    known = [*names, *ArmParameters.__dataclass_fields__, *Settings.__dataclass_fields__]
    assert text.startswith(tuple(known)), text


def taken(options: dict[str, Any]) -> Settings | None:
    began = time.perf_counter()
    try:
        return Settings.of(options)
    except Exception as error:
        refusal_names_it(error, options)
        return None
    finally:
        assert time.perf_counter() - began < LONGEST


FAST = settings(max_examples=60, deadline=None, suppress_health_check=list(HealthCheck))
THOROUGH = settings(max_examples=1500, deadline=None, suppress_health_check=list(HealthCheck))


@FAST
@given(any_options())
def test_options_are_taken_or_refused_by_name(options: dict[str, Any]) -> None:
    taken(options)


@pytest.mark.parametrize("name", NAMES)
def test_garbage_is_refused_by_name(name: str) -> None:
    for value in GARBAGE:
        try:
            SETTINGS_FIELDS[name].check(name, value)  # what is taken is put together above
        except Exception as error:
            refusal_names_it(error, {name: value})


@pytest.mark.slow
@THOROUGH
@given(any_options())
def test_options_are_taken_or_refused_by_name_thoroughly(options: dict[str, Any]) -> None:
    taken(options)


@pytest.mark.slow
@settings(THOROUGH, max_examples=300)
@given(any_options(garbage=False), st.integers(0, 2**32 - 1))
def test_what_is_taken_runs(options: dict[str, Any], seed: int) -> None:
    """Finite numbers within the bounds, no warning, in time."""
    if taken(options) is None:
        return
    try:
        env = FlexArmEnv(**options)
    except ValueError as error:  # starts too fast for the reference
        refusal_names_it(error, options)
        return
    env.reset(seed=seed)  # compiles
    rng = np.random.default_rng(seed)
    began = time.perf_counter()
    for _ in range(4):
        action = rng.uniform(-1.0, 1.0, env.action_space.shape).astype(np.float32)
        observation, reward, terminated, _, _ = env.step(action)
        assert env.observation_space.contains(observation), options
        assert math.isfinite(reward)
        if terminated:
            env.reset()
    assert time.perf_counter() - began < LONGEST


def finite_arm(parameters: dict[str, Any], seed: int) -> None:
    """All that an arm computes is finite, at ordinary states and at the largest that are accepted."""
    try:
        arm = FlexibleArm(ArmParameters.linear(**parameters))
    except (TypeError, ValueError) as error:
        refusal_names_it(error, parameters)
        return
    rng = np.random.default_rng(seed)
    n, (length_1, length_2) = arm.size, arm.parameters.link_lengths
    assert 0.0 < arm.fastest_rate() < math.inf
    for state in (np.zeros(2 * n), rng.normal(size=2 * n), np.full(2 * n, 1e12), -(10.0 ** rng.uniform(-9, 12, 2 * n))):
        q = state[:n]
        found = [
            *(arm.acceleration(state, (1e3, -1e3)), *arm.energy(state), arm.angular_momentum(state)),
            *(arm.velocity(state, 2, length_2), arm.point_jacobian(q, 1, length_1), arm.mass_matrix(q)),
            *(arm.tip(q), arm.rigid_tip(q), arm.tip_deflection(q), arm.velocity_forces(q, state[n:])),
            *(arm.linearise(state).A, arm.internal_state(state), arm.public_state(state)),
        ]
        assert all(np.isfinite(array).all() for array in found)


@FAST
@given(declared_arms(), st.integers(0, 2**32 - 1))
@example({"elbow_mass": 10.0, "kinematics": "foreshortened", "mode_scale": 1e6}, 0)  # the inertia was singular
@example({"elbow_mass": 10.0, "kinematics": "foreshortened", "mode_scale": 1e3}, 0)
def test_arms_compute_finite_numbers(parameters: dict[str, Any], seed: int) -> None:
    finite_arm(parameters, seed)


@pytest.mark.slow
@THOROUGH
@given(declared_arms(), st.integers(0, 2**32 - 1))
def test_arms_compute_finite_numbers_thoroughly(parameters: dict[str, Any], seed: int) -> None:
    finite_arm(parameters, seed)


@pytest.mark.parametrize("kind", [ArmParameters, SensorParameters, LawParameters, SquareParameters])
def test_garbage_among_parameters_is_refused_by_name(kind: type) -> None:
    for one in fields(kind):
        for value in GARBAGE:
            try:
                kind(**{one.name: value})
            except Exception as error:
                refusal_names_it(error, {one.metadata["name"] or one.name: value})


ARM = FlexibleArm(ArmParameters.linear())
ZEROS = np.zeros((2, ARM.size))
RUN: dict[str, Any] = {"time": np.zeros(2), "state": np.zeros((2, 2 * ARM.size)), "torque": np.zeros((2, 2))}
CALLS: dict[str, Callable[[Any], Any]] = {
    "point": lambda value: inverse_kinematics(ARM.parameters, value, "positive"),
    "elbow_branch": lambda value: inverse_kinematics(ARM.parameters, (1.0, 2.0), value),
    "table": ReferencePath,
    "waypoints": lambda value: way_points(SquareParameters(), value),
    "time": square(SquareParameters()).position,
    "shoulder_to_elbow": SensorParameters().joint_delays,
    "parameters": FlexibleArm,
    "q": ARM.tip,
    "state": ARM.energy,
    "s": lambda value: ARM.position(ZEROS[0], 1, value),
    "link": lambda value: ARM.position(ZEROS[0], value, 1.0),
    "torque": lambda value: ARM.acceleration(ZEROS.ravel(), value),
    "gain": lambda value: ARM.record(**RUN, gain=value),
    "notes": lambda value: ARM.record(**RUN, notes=value),
    "time of a run": lambda value: ARM.record(**(RUN | {"time": value})),
    "state of a run": lambda value: ARM.record(**(RUN | {"state": value})),
    "torque of a run": lambda value: ARM.record(**(RUN | {"torque": value})),
}


@pytest.mark.parametrize("name", CALLS)
def test_garbage_as_an_argument_is_refused_by_name(name: str) -> None:
    for value in GARBAGE:
        for given_value in (value, [value] * 2, [value] * 12):
            try:
                CALLS[name](given_value)
            except Exception as error:
                refusal_names_it(error, [name.partition(" ")[0], "state"])

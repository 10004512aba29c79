"""What is drawn for parameters and options: what is allowed, its edges, what is just beyond, and garbage.

It is a sample, or a campaign with `pytest --hypothesis-profile=campaign`.
"""

import math
from collections.abc import Iterable
from dataclasses import fields
from datetime import timedelta
from decimal import Decimal
from fractions import Fraction
from typing import Any

import numpy as np
from hypothesis import HealthCheck, settings
from hypothesis import strategies as st

from flexarm_env.actions import MODES
from flexarm_env.allowed import Flag, Integer, Number, OneOf, Optional, Pair
from flexarm_env.envs.blocks import BLOCKS
from flexarm_env.envs.settings import Settings
from flexarm_env.episode.reward import OF_RACES, TERMS
from flexarm_env.kernels.entries import DRAWN
from flexarm_env.parameters import ArmParameters

CAMPAIGN = settings.get_current_profile_name() == "campaign"
LONGEST = timedelta(seconds=120)  # that a case may take on a busy machine
MOST_CHARACTERS = 2000  # of a message


def amount(sample: int, campaign: int) -> int:
    return campaign if CAMPAIGN else sample


def cases(sample: int, campaign: int) -> settings:
    """Return hypothesis's settings for so many cases; a sample has the same cases in each run."""
    count = amount(sample, campaign)
    return settings(
        max_examples=count, deadline=LONGEST, derandomize=not CAMPAIGN, suppress_health_check=list(HealthCheck)
    )


class Contrary:
    def __repr__(self) -> str:
        raise RuntimeError("no repr")

    def __float__(self) -> float:
        raise RuntimeError("no float")

    def __array__(self, *arguments: Any, **named: Any) -> Any:
        raise RuntimeError("no array")


# fmt: off
GARBAGE: list[Any] = [
    None, True, False, 0, -1, 3, 0.0, -0.0, 1.5, -1.0, 1e-320, 1e-12, 1e12, 1e300, -1e308, math.nan, math.inf, 1j,
    10**400, 10**5000, Fraction(1, 3), Decimal("0.1"),
    "", "x", "square", "\x00", "x" * 100_000, b"ab", bytearray(b"ab"), memoryview(b"ab"),
    [], (), [1.0], (1.0, 2.0), [1.0, 2.0, 3.0], [1.0] * 2000, [[1.0, 2.0], [3.0, 4.0]], [None, 1.0], ["x", "y"],
    {}, {"x": 1.0}, {"x" * 100_000: "y"}, {1: 2}, {"effort": 1.0}, {"noise": (0.0, 1.0)},
    {1.0, 2.0}, frozenset((1.0, 2.0)), range(2), iter((1.0, 2.0)), object(), Contrary(), len, int,
    np.float32(0.5), np.float16(0.1), np.int8(1), np.bool_(True), np.longdouble("1e4000"), np.datetime64("2026-01-01"),
    np.array(0.5), np.array(True), np.array("true"), np.array([1, 2]), np.array(["a", "b"]), np.array([1.0, None]),
    np.zeros(0), np.ones(2), np.ones((2, 2)), np.zeros((0, 2)), np.array([np.nan, 1.0]), np.ones(2) * 1j,
]
# fmt: on


def numbers(least: float, most: float) -> st.SearchStrategy[float]:
    """Draw the bounds, what is just beyond them, and magnitudes evenly between them."""
    edges = [least, most, float(np.nextafter(least, -np.inf)), float(np.nextafter(most, np.inf))]
    low = max(least, 1e-9)
    exponents = st.floats(math.log10(low), math.log10(most))
    return st.sampled_from(edges) | exponents.map(lambda x: min(max(10.0**x, least), most))


def inside(allowed: Any) -> st.SearchStrategy[Any]:
    """Draw values that a declaration allows by itself, or nearly."""
    if isinstance(allowed, Optional):
        return st.none() | inside(allowed.other)
    if isinstance(allowed, Pair | Number):
        one = numbers(allowed.least, allowed.most)
        return st.tuples(one, one) if isinstance(allowed, Pair) else one
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
    "action_mode": st.sampled_from([name for name in MODES if name not in ("torque_rate", "race")]),  # few kernels
    "delay": numbers(0.0, 10.0) | st.tuples(numbers(0.0, 10.0), numbers(0.0, 10.0)),
    "sensor_period": numbers(1e-6, 10.0),
    "observation": st.lists(st.sampled_from(sorted(BLOCKS)), min_size=1, max_size=5, unique=True),
    "previews": st.lists(numbers(1e-6, 1e5), max_size=4),
    "reference": st.sampled_from(["square", "circle", "line", "figure_eight", "moves", "waypoints"]),
    "waypoints": st.lists(st.tuples(numbers(1e-3, 1e6), numbers(1e-3, 8.0)), max_size=4),
    "randomisation": ranges(),
    "reward_weights": st.dictionaries(
        st.sampled_from(sorted(set(TERMS) - set(OF_RACES))), numbers(0.0, 1e12), min_size=1, max_size=3
    ),
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


def check_refusal(error: Exception, names: Iterable[str]) -> None:
    """Check that a message is short and begins with what was given, or with another option or arm's field."""
    text = str(error)
    fields_of = [*ArmParameters.__dataclass_fields__, *Settings.__dataclass_fields__]
    known = [*names, *fields_of, "Settings.__init__() got an unexpected keyword argument"]
    assert type(error) in (TypeError, ValueError), repr(error)
    assert len(text) < MOST_CHARACTERS, f"a message of {len(text)} characters"
    assert text.startswith(tuple(known)), text

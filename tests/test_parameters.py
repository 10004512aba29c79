"""Input is checked at the border: every error names the parameter, its value, and what is allowed."""

from collections.abc import Callable
from dataclasses import FrozenInstanceError, asdict, fields, replace
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from flexarm_env import ArmParameters, LawParameters, SensorParameters, SquareParameters
from flexarm_env.parameters import PRESETS, arm_parameters
from flexarm_env.validation import finite_array, finite_rows, integer, number
from tests.support.lagrange import arms
from tests.support.refusals import refused, refuses, right_values, wrong_values

CLASSES = (ArmParameters, SensorParameters, LawParameters, SquareParameters)

FIELDS = [(kind, one) for kind in CLASSES for one in fields(kind)]


@pytest.mark.parametrize("bad", [-1.0, -1e-300, np.nan, np.inf, -np.inf, 10**400, True, np.True_, "1.0", 1j], ids=str)
def test_bad_numbers_are_refused(bad: Any) -> None:
    """That each field is checked, the next test shows."""
    error = ValueError if type(bad) in (int, float) else TypeError
    places: dict[str, Any] = {
        "delay": lambda: SensorParameters(delay=bad),
        "delay[1]": lambda: SensorParameters(delay=(0.0, bad)),
        "payload_mass": lambda: ArmParameters(payload_mass=bad),
        "link_lengths[0]": lambda: ArmParameters(link_lengths=(bad, 1.0)),
    }
    for place, make in places.items():
        with refuses(error, f"{place} = {bad!r}: must be ", "[s]" if "delay" in place else "<= "):
            make()


@pytest.mark.parametrize(("kind", "field"), FIELDS, ids=lambda part: getattr(part, "name", None))
def test_what_a_field_may_be(kind: Any, field: Any) -> None:
    """The bounds and names of its declaration are taken, all else is refused; the delay is checked by a function."""
    wrong = wrong_values(field.metadata["name"] or field.name, field.metadata["allowed"])
    assert wrong or (kind, field.name) == (SensorParameters, "delay")
    for value, error, message in wrong:
        with refuses(error, message):
            kind(**{field.name: value})
    for value in right_values(field.metadata["allowed"]):
        made = ArmParameters.linear if (kind, value) == (ArmParameters, "rigid") else kind  # C_r (7)
        assert getattr(made(**{field.name: value}), field.name) == value


# fmt: off
NO_PAIRS: list[Any] = [
    memoryview(b"ab"), bytearray(b"ab"), iter((1.0, 2.0)), 1.0, None, (1.0,), (1.0, 2.0, 3.0), "ab", b"ab", {1.0, 2.0},
    {"a": 1.0, "b": 2.0}, np.array(1.0),
]
# fmt: on


def test_what_is_no_pair_is_refused() -> None:
    for bad in NO_PAIRS:
        with refuses(TypeError, f"link_lengths = {bad!r}: must be a pair of numbers"):
            ArmParameters(link_lengths=bad)
    with refuses(TypeError, "link_lengths[0] = array([1., 1.]): must be a finite number"):
        ArmParameters(link_lengths=np.ones((2, 2)))  # type: ignore[arg-type]


def test_more_damping_than_critical_is_refused() -> None:
    with refuses(ValueError, "damping_ratio = 1.01", "<= 1.0"):
        ArmParameters(damping_ratio=1.01)


def test_a_collocated_sensor_has_no_delay_and_a_true_one_a_single_one() -> None:
    for delay in (0.0, 0.01, (0.01, 0.02)):
        with refuses(ValueError, "delay = ", "collocated", "None"):
            SensorParameters(model="collocated", delay=delay)
    assert SensorParameters(model="collocated").joint_delays(4.5) == (0.0, 0.0)
    with refuses(ValueError, "delay = (0.01, 0.02)", "one number"):
        SensorParameters(model="true", delay=(0.01, 0.02))
    assert SensorParameters(model="true", delay=0.01).joint_delays(4.5) == (0.01, 0.01)
    assert SensorParameters(model="true").joint_delays(4.5) == pytest.approx((9.0 / 288.33, 9.0 / 288.33))


def test_delays_are_the_papers() -> None:
    # (16), (18) and their like at 0.5 m: printed with three or four digits
    np.testing.assert_allclose(SensorParameters().joint_delays(4.5), [31.2e-3, 15.6e-3], rtol=2e-3)
    np.testing.assert_allclose(SensorParameters(position=0.5).joint_delays(4.5), [17.34e-3, 1.734e-3], rtol=3e-4)
    assert SensorParameters(delay=0.02).joint_delays(4.5) == (0.02, 0.02)
    assert SensorParameters(delay=(0.02, 0.01)).joint_delays(4.5) == (0.02, 0.01)
    assert SensorParameters(wave_speed=100.0).joint_delays(4.5) == (0.09, 0.045)


@pytest.mark.parametrize("delay", [np.float32(0.25), np.int64(2), Fraction(1, 4), 1])
@pytest.mark.parametrize("model", ["rigid", "true"])
def test_any_real_number_is_a_delay(model: Any, delay: Any) -> None:
    stored = SensorParameters(model=model, delay=delay).delay
    assert stored == float(delay)
    assert type(stored) is float


@given(arms())
def test_arm_parameters_keep_what_they_are_given(parameters: ArmParameters) -> None:
    again = ArmParameters(**asdict(parameters))
    assert (again, hash(again)) == (parameters, hash(parameters))
    assert parameters.reach == sum(parameters.link_lengths)


def test_values_take_their_canonical_types() -> None:
    loose: Any = {
        "link_lengths": np.array([4, 5], dtype=np.float32),
        "flexural_rigidities": [1000, Fraction(1, 2)],
        "modes_per_link": np.int64(3),
        "payload_mass": np.float32(0.5),
        "elbow_mass": 2,
    }
    parameters = ArmParameters(**loose)
    assert parameters.link_lengths == (4.0, 5.0)
    assert {type(x) for x in (*parameters.link_lengths, *parameters.flexural_rigidities)} == {float}
    assert {type(parameters.payload_mass), type(parameters.elbow_mass)} == {float}
    assert type(parameters.modes_per_link) is int
    assert parameters == ArmParameters((4.0, 5.0), (1000.0, 0.5), modes_per_link=3, payload_mass=0.5, elbow_mass=2.0)


@pytest.mark.parametrize("kind", CLASSES)
def test_sets_are_frozen_and_replaceable(kind: Any) -> None:
    parameters = kind()
    name = fields(kind)[0].name
    with pytest.raises(TypeError, match="no_such_parameter"):
        kind(no_such_parameter=1.0)
    with pytest.raises(FrozenInstanceError):
        setattr(parameters, name, getattr(parameters, name))
    assert replace(parameters) == parameters
    with pytest.raises((TypeError, ValueError)):
        replace(parameters, **{name: object()})  # a changed set is checked again


def test_papers_arm() -> None:
    paper = ArmParameters.paper()
    assert (paper.modes_per_link, paper.velocity_forces) == (1, "rigid")
    assert (paper.damping_ratio, paper.mode_scale) == (0.0, 0.1)
    assert (paper.link_lengths, paper.flexural_rigidities) == ((4.5, 4.5), (1676.0, 1676.0))
    assert paper.masses_per_length == (0.335, 0.335)
    assert ArmParameters.paper(modes_per_link=2, payload_mass=1.0).payload_mass == 1.0
    assert (LawParameters().proportional_gain, LawParameters().derivative_gain) == (150.79, 17.364)


@pytest.mark.parametrize("name", PRESETS)
def test_an_arm_has_the_same_parameters_by_its_name_everywhere(name: str) -> None:
    arm = ArmParameters.named(name, payload_mass=0.5)
    assert arm_parameters({"preset": name, "payload_mass": 0.5}) == arm
    assert replace(arm_parameters(name), payload_mass=0.5) == arm
    assert ArmParameters.named("default") == ArmParameters()
    assert ArmParameters.linear() == ArmParameters.named("linear")


def test_an_unknown_arm_is_refused_with_all_names() -> None:
    for make in (ArmParameters.named, arm_parameters):
        with refuses(ValueError, "'new'", *map(repr, PRESETS)):
            make("new")
    with refuses(TypeError, "arm = 3", *map(repr, PRESETS)):
        arm_parameters(3)  # type: ignore[arg-type]


@given(st.floats(allow_nan=True, allow_infinity=True), st.floats(-10.0, 10.0), st.floats(-10.0, 10.0))
def test_number_accepts_exactly_what_it_says(value: float, low: float, high: float) -> None:
    one_sided = ({"above": low}, value > low), ({"least": low}, value >= low), ({"most": high}, value <= high)
    for bounds, inside in (*one_sided, ({"least": low, "most": high}, low <= value <= high)):
        if np.isfinite(value) and inside:
            assert number("x", value, "m", **bounds) == value
        else:
            with refuses(ValueError, "x = ", "must be a finite number", "[m]"):
                number("x", value, "m", **bounds)


@given(st.integers(-100, 100), st.integers(-10, 10), st.integers(-10, 10))
def test_integer_accepts_exactly_what_it_says(value: int, least: int, most: int) -> None:
    if least <= value <= most:
        assert integer("n", value, least, most) == value
    else:
        with refuses(ValueError, f"n = {value}: must be an integer from {least} to {most}"):
            integer("n", value, least, most)
    if value < least:
        with refuses(ValueError, f"n = {value}: must be an integer >= {least}"):
            integer("n", value, least)


OF_NUMBERS = "array of real numbers"
test_bad_arrays_are_refused = refused(
    ([1.0, 2.0], r"a: must have shape \(n, 2\), got \(2,\)"),
    (np.zeros((2, 3)), r"must have shape \(n, 2\), got \(2, 3\)"),
    (1.0, r"must have shape \(n, 2\), got \(\)"),
    ([[1.0, 2.0], [3.0, np.nan]], r"a\[1, 1\] = nan: must be finite"),
    ([[1.0, -np.inf]], r"a\[0, 1\] = -inf: must be finite"),
    ([[1.0, 2.0], [3.0]], f"a: must be an {OF_NUMBERS}"),
    *(([[bad, 2.0]], f"a = .*{OF_NUMBERS}") for bad in ("1.0", None, 1j)),
    ([[True, False]], f"a = .*{OF_NUMBERS}"),
    ("ab", f"a = 'ab'.*{OF_NUMBERS}"),
    by=lambda bad: finite_array("a", bad, (None, 2)),
)


@pytest.mark.parametrize("check", [lambda a: finite_array("a", a, (3, 2)), lambda a: finite_rows("a", a, 2)])
def test_checked_arrays_are_copies(check: Callable[[Any], np.ndarray]) -> None:
    mine = np.ones((3, 2))
    checked = check(mine)
    checked[:] = 7.0
    np.testing.assert_array_equal(mine, 1.0)
    assert check(mine.astype(np.float32)).dtype == check([[1, 2]] * 3).dtype == np.float64


def test_rows_admit_any_leading_axes() -> None:
    for shape in ((2,), (5, 2), (3, 0, 2), (4, 3, 2)):
        assert finite_rows("a", np.zeros(shape), 2).shape == shape
    for bad in (0.0, np.zeros(3), np.zeros((2, 1))):
        with refuses(ValueError, "a: must have shape (..., 2), got"):
            finite_rows("a", bad, 2)

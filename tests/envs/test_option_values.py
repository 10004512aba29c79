"""Values of options: which types are taken, and messages that name what is wrong in few words."""

from __future__ import annotations

import math
from dataclasses import fields
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

from flexarm_env.allowed import Allowed, Flag, Integer, Number, OneOf, Optional, Pair, allowed_of
from flexarm_env.envs.settings import Settings
from tests.envs.test_options import MESSAGES
from tests.support.envs import SQUARE, make
from tests.support.refusals import refuses


def test_lists_as_json_has_them_are_tuples() -> None:
    settings = Settings.of({"previews": [0.1], "torque_limit": [1.0, 2.0], "delay": [0.1, 0.2], "sensor": "rigid"})
    assert (settings.previews, settings.torque_limit, settings.reference) == ((0.1,), (1.0, 2.0), ("square",))
    assert settings.delay == settings.sensor_parameters.delay == (0.1, 0.2)


def test_numbers_of_numpy_are_numbers() -> None:
    given = {"delay": np.array(0.01), "noise": np.float32(0.5), "sensor": np.array("true"), "scaled": np.array(False)}
    settings = Settings.of(given | {"previews": np.array([0.1, 0.2]), "last_actions": np.int8(3)})
    assert (settings.delay, settings.noise, settings.sensor, settings.scaled) == (0.01, 0.5, "true", False)
    assert (settings.previews, settings.last_actions) == ((0.1, 0.2), 3)
    assert {type(x) for x in (settings.delay, settings.noise, *settings.previews)} == {float}
    assert (type(settings.sensor), type(settings.scaled), type(settings.last_actions)) == (str, bool, int)


@pytest.mark.parametrize("value", ["x" * 100_000, [1.0] * 100_000, {"x" * 100_000: "y"}, 10**100_000], ids=type)
@pytest.mark.parametrize("name", ["delay", "sensor", "arm", "observation", "reward_weights", "last_actions"])
def test_messages_stay_short(name: str, value: Any) -> None:
    with pytest.raises((TypeError, ValueError), match=name) as caught:
        Settings.of({name: value})
    assert len(str(caught.value)) < 1500


@pytest.mark.parametrize(
    ("option", "near"),
    [
        ("frameskip", "'frame'"),
        ("sensor_delay", "'delay' or 'sensor' or 'second_sensor_delay'"),
        ("gan_limit", "'gain_limit'"),
    ],
)
def test_an_unknown_option_is_refused_in_pythons_words(option: str, near: str) -> None:
    """TorchRL looks for these."""
    expected = rf"__init__\(\) got an unexpected keyword argument '{option}'; did you mean {near}\?"
    for made in (lambda: make(**{option: 1}), lambda: gym.make_vec(SQUARE, num_envs=2, **{option: 1})):
        with pytest.raises(TypeError, match=expected) as caught:
            made()
        assert len(str(caught.value)) < 250


def wrong_values(name: str, allowed: Allowed) -> list[tuple[Any, type[Exception], str]]:
    """Return values that a declaration does not allow, with the error and its message; none for functions' checks."""
    if isinstance(allowed, Optional):
        return wrong_values(name, allowed.other)
    if isinstance(allowed, Pair):
        each = wrong_values(f"{name}[1]", Number(allowed.least, allowed.most, allowed.unit))
        pairs = [((allowed.least, value), error, message) for value, error, message in each]
        return [*pairs, (0.5, TypeError, f"{name} = 0.5: must be a pair of numbers [{allowed.unit}]")]
    if isinstance(allowed, Number):
        unit = f" [{allowed.unit}]" if allowed.unit else ""
        rule = f"must be a finite number and >= {allowed.least} and <= {allowed.most}{unit}"
        beyond = [math.nextafter(allowed.least, -math.inf), math.nextafter(allowed.most, math.inf), math.nan]
        wrong = [(value, ValueError) for value in beyond] + [(value, TypeError) for value in ("1", True)]
        return [(value, error, f"{name} = {value!r}: {rule}") for value, error in wrong]
    if isinstance(allowed, Integer):
        rule = f"must be an integer from {allowed.least} to {allowed.most}"
        wrong = [(allowed.least - 1, ValueError), (allowed.most + 1, ValueError), (1.0, TypeError), (True, TypeError)]
        return [(value, error, f"{name} = {value!r}: {rule}") for value, error in wrong]
    if isinstance(allowed, OneOf):
        rule = f"must be one of {', '.join(map(repr, allowed.names))}"
        return [(value, ValueError, f"{name} = {value!r}: {rule}") for value in ("other", 1)]
    return [(1, TypeError, f"{name} = 1: must be True or False")] if isinstance(allowed, Flag) else []


@pytest.mark.parametrize("name", [one.name for one in fields(Settings)])
def test_what_an_option_may_be(name: str) -> None:
    """Its declaration refuses all else; those that a function checks have their messages in `test_options`."""
    wrong = wrong_values(name, allowed_of(Settings, name))
    assert wrong or any(name in options for _, options, *_ in MESSAGES)
    for value, error, message in wrong:
        with refuses(error, message):
            Settings.of({name: value})

"""`predictor`: one way to call a policy, whichever of the usual forms it has."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexarm_env.validation import shown

Predictor = Callable[[Any, Any, NDArray[np.bool_]], tuple[Any, Any]]
_NAMES = ("state", "episode_start", "deterministic")  # after the observation, in this order
_FORMS = (
    "must have predict(observation) or predict(observation, state, episode_start, deterministic), "
    "or be a function of an observation"
)


def predictor(policy: Any, deterministic: bool) -> Predictor:
    """Return a function that calls a policy, whichever form it has; its signature is inspected here, once.

    Args:
        policy: an object with stable-baselines3's ``predict(observation, state, episode_start, deterministic)``, with a
            ``predict`` that takes the observation and any of the other three by their names, or a function of the
            observation. It returns an action, or the pair of an action and a state.
        deterministic: passed to a ``predict`` that takes it.

    Returns:
        A function of observation, state and episode start that returns action and state.

    Raises:
        TypeError: for a class, or what cannot be called in one of these forms.
    """
    if inspect.isclass(policy):
        raise TypeError(f"policy = {shown(policy)}: is a class; make a policy of it first")
    method = getattr(policy, "predict", None)
    call = policy if method is None else method
    if not callable(call):
        raise TypeError(f"policy = {shown(policy)}: {_FORMS}")
    if method is None:
        signature = _signature(call)
        if signature is not None and not _binds(signature, 1):
            raise TypeError(f"policy = {shown(policy)}: {_FORMS}, its parameters are {signature}")
        return lambda observation, state, start: _pair(call(observation), state)
    signature = _signature(method)
    if signature is None or (_binds(signature, 4) and _in_order(signature)):
        return lambda observation, state, start: _pair(method(observation, state, start, deterministic), state)
    named = _named(signature)
    if not _binds(signature, 1, named):
        raise TypeError(f"policy = {shown(policy)}: {_FORMS}; the parameters of its predict are {signature}")

    def predict(observation: Any, state: Any, start: NDArray[np.bool_]) -> tuple[Any, Any]:
        values = {"state": state, "episode_start": start, "deterministic": deterministic}
        return _pair(method(observation, **{name: values[name] for name in named}), state)

    return predict


def _signature(call: Callable[..., Any]) -> inspect.Signature | None:
    """Return the parameters of a callable; None for one that has no signature, as of another language."""
    try:
        return inspect.signature(call)
    except ValueError:
        return None


def _named(signature: inspect.Signature) -> tuple[str, ...]:
    """Return the parameters after the first, the observation, that go by the names of stable-baselines3."""
    by_name = (inspect.Parameter.POSITIONAL_OR_KEYWORD, inspect.Parameter.KEYWORD_ONLY)
    others = [one.name for one in list(signature.parameters.values())[1:] if one.kind in by_name]
    return tuple(name for name in _NAMES if name in others)


def _in_order(signature: inspect.Signature) -> bool:
    """Return whether positional parameters with the names of stable-baselines3 have the places that they have there."""
    positional = (inspect.Parameter.POSITIONAL_ONLY, inspect.Parameter.POSITIONAL_OR_KEYWORD)
    found = [one.name for one in signature.parameters.values() if one.kind in positional]
    return all(found.index(name) == place for place, name in enumerate(_NAMES, 1) if name in found[1:])


def _binds(signature: inspect.Signature, count: int, named: tuple[str, ...] = ()) -> bool:
    """Return whether a call with so many positional arguments, and these by name, is possible."""
    try:
        signature.bind(*range(count), **dict.fromkeys(named))
    except TypeError:
        return False
    return True


def _pair(result: Any, state: Any) -> tuple[Any, Any]:
    """Split into action and state: a pair of numbers is an action; a pair that begins with an array is both."""
    if isinstance(result, tuple) and len(result) == 2 and np.ndim(result[0]) > 0:
        return result
    return result, state

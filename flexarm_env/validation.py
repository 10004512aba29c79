"""Checks shared by everything that takes a user's input.

Each function returns the checked value in its canonical type, or raises an error that names the parameter, the
value it got and what is allowed. Nothing is clipped or replaced.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Mapping, Sequence
from numbers import Integral, Real
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray


def number(
    name: str,
    value: object,
    unit: str = "",
    *,
    above: float | None = None,
    least: float | None = None,
    most: float | None = None,
) -> float:
    """Check one finite real number.

    Args:
        name: parameter name for the message.
        value: what the user gave.
        unit: physical unit for the message, e.g. "m".
        above: exclusive lower bound.
        least: inclusive lower bound.
        most: inclusive upper bound.

    Returns:
        The value as a float.

    Raises:
        TypeError: if it is not a real number (booleans are not).
        ValueError: if it is not finite or out of range.
    """
    bounds = [
        text
        for text, bound in ((f"> {above}", above), (f">= {least}", least), (f"<= {most}", most))
        if bound is not None
    ]
    allowed = " and ".join(["a finite number", *bounds]) + (f" [{unit}]" if unit else "")
    if isinstance(value, bool) or not isinstance(value, Real):
        raise TypeError(f"{name} = {value!r}: must be {allowed}")
    try:
        x = float(value)
    except OverflowError:  # an integer beyond the largest float
        x = np.inf
    out_of_range = (
        (above is not None and not x > above)
        or (least is not None and not x >= least)
        or (most is not None and not x <= most)
    )
    if not np.isfinite(x) or out_of_range:
        raise ValueError(f"{name} = {value!r}: must be {allowed}")
    return x


def integer(name: str, value: object, least: int, most: int | None = None) -> int:
    """Check one integer in [least, most].

    Raises:
        TypeError: if it is not an integer (booleans and floats are not).
        ValueError: if it is out of range.
    """
    allowed = f"an integer >= {least}" if most is None else f"an integer from {least} to {most}"
    if isinstance(value, bool) or not isinstance(value, Integral):
        raise TypeError(f"{name} = {value!r}: must be {allowed}")
    n = int(value)
    if n < least or (most is not None and n > most):
        raise ValueError(f"{name} = {value!r}: must be {allowed}")
    return n


def pair(
    name: str,
    value: object,
    unit: str = "",
    *,
    above: float | None = None,
    least: float | None = None,
    most: float | None = None,
) -> tuple[float, float]:
    """Check two finite numbers, one for each link or joint; bounds as in `number`."""
    values: list[object] = []
    if isinstance(value, Sequence | np.ndarray) and not isinstance(value, str | bytes | bytearray):
        values = list(np.atleast_1d(value)) if isinstance(value, np.ndarray) else list(value)
    if len(values) != 2:
        raise TypeError(f"{name} = {value!r}: must be a pair of numbers" + (f" [{unit}]" if unit else ""))
    first, second = (number(f"{name}[{i}]", x, unit, above=above, least=least, most=most) for i, x in enumerate(values))
    return first, second


def choice(name: str, value: object, allowed: Iterable[str]) -> str:
    """Check that a string option is one of the allowed names.

    Raises:
        ValueError: naming the allowed ones.
    """
    names = list(allowed)
    if not isinstance(value, str) or value not in names:
        raise ValueError(f"{name} = {value!r}: must be one of {', '.join(map(repr, names))}")
    return value


def finite_array(name: str, value: ArrayLike, shape: tuple[int | None, ...]) -> NDArray[np.float64]:
    """Check an array of finite numbers against a shape (None admits any length on that axis).

    Returns:
        A new float64 array, so that the caller's is never changed.

    Raises:
        ValueError: for another shape, or naming the index of the first entry that is not finite.
    """
    array = real_array(name, value)
    if array.ndim != len(shape) or any(n is not None and n != m for n, m in zip(shape, array.shape, strict=True)):
        wanted = "(" + ", ".join("n" if n is None else str(n) for n in shape) + (",)" if len(shape) == 1 else ")")
        raise ValueError(f"{name}: must have shape {wanted}, got {array.shape}")
    if not np.all(np.isfinite(array)):
        index = tuple(int(i) for i in np.argwhere(~np.isfinite(array))[0])
        raise ValueError(f"{name}{list(index)} = {array[index]}: must be finite")
    return array


def finite_rows(name: str, value: ArrayLike, last: int) -> NDArray[np.float64]:
    """Check an array of finite numbers with a given last axis and any number of leading ones.

    Returns:
        A new float64 array.

    Raises:
        ValueError: for another shape, or naming the index of the first entry that is not finite.
    """
    array = real_array(name, value)
    if array.ndim == 0 or array.shape[-1] != last:
        raise ValueError(f"{name}: must have shape (..., {last}), got {array.shape}")
    return finite_array(name, array, tuple(array.shape))


def real_array(name: str, value: ArrayLike) -> NDArray[np.float64]:
    """Check an array of real numbers of any shape; strings, booleans, complex numbers and ragged lists are refused.

    Returns:
        A new float64 array.

    Raises:
        ValueError: for anything else.
    """
    try:
        array = np.asarray(value)
    except (TypeError, ValueError) as error:
        raise ValueError(f"{name}: must be an array of real numbers ({error})") from None
    if array.dtype.kind not in "iuf":
        raise ValueError(f"{name} = {value!r}: must be an array of real numbers")
    return array.astype(np.float64)


def listed(name: str, value: object) -> list[Any]:
    """Check that an option is a list or tuple.

    Raises:
        TypeError: for anything else.
    """
    if not isinstance(value, list | tuple):
        raise TypeError(f"{name} = {value!r}: must be a list or a tuple")
    return list(value)


def names(name: str, value: object) -> tuple[str, ...]:
    """Check that an option is a list of different names.

    Raises:
        TypeError: for anything else.
        ValueError: if it is empty or a name comes twice.
    """
    entries = listed(name, value)
    if not all(isinstance(entry, str) for entry in entries):
        raise TypeError(f"{name} = {value!r}: must hold names")
    if not entries or len(set(entries)) < len(entries):
        raise ValueError(f"{name} = {value!r}: must hold at least one name, and each only once")
    return tuple(entries)


def known_names(what: str, given: Iterable[str], known: Sequence[str]) -> None:
    """Check the names of keyword arguments.

    Args:
        what: one of them is called, e.g. "option".
        given: by the user.
        known: that there are.

    Raises:
        TypeError: for the first that is not known, with the nearest known one.
    """
    for name in given:
        if name not in known:
            near = difflib.get_close_matches(name, known, 1)
            hint = f"; did you mean {near[0]!r}?" if near else "."
            raise TypeError(f"{name}: no such {what}{hint} The {what}s are {', '.join(known)}")


def mapping(name: str, value: object) -> dict[str, Any]:
    """Check that an option is a mapping.

    Raises:
        TypeError: for anything else.
    """
    if not isinstance(value, Mapping):
        raise TypeError(f"{name} = {value!r}: must be a mapping of names")
    return dict(value)


def flag(name: str, value: object) -> bool:
    """Check that an option is True or False.

    Raises:
        TypeError: for anything else.
    """
    if not isinstance(value, bool | np.bool_):
        raise TypeError(f"{name} = {value!r}: must be True or False")
    return bool(value)

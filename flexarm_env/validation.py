"""Checks shared by everything that takes a user's input.

Each function returns the checked value in its canonical type, or raises an error that names the parameter, the
value it got and what is allowed. Nothing is clipped or replaced.
"""

from __future__ import annotations

import difflib
import math
import reprlib
from collections.abc import Iterable, Mapping, Sequence
from numbers import Integral, Real
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

_LONGEST = 500  # characters of a value in a message
# Sequences of characters or bytes: never meant as numbers, though Python gives their entries as such.
_TEXTS = (str, bytes, bytearray, memoryview)


class _Short(reprlib.Repr):
    """Repr of any value, cut where it is long."""

    def __init__(self) -> None:
        super().__init__()
        self.maxstring = self.maxother = self.maxlong = _LONGEST
        self.maxlist = self.maxtuple = self.maxdict = self.maxset = self.maxfrozenset = self.maxdeque = 24

    def repr_int(self, x: int, level: int) -> str:
        """Python refuses to write integers of several thousand digits."""
        return super().repr_int(x, level) if x.bit_length() < 4 * _LONGEST else f"<integer of {x.bit_length()} bits>"


def shown(value: object) -> str:
    """Return a user's value for a message: its repr, shortened where it is long."""
    try:
        text = _Short().repr(value)
    except Exception:  # a repr of the user's may raise anything, and the refusal must still be shown
        text = f"<{type(value).__name__}>"
    return short(text)


def short(text: str) -> str:
    """Return a text for a message, without its middle where it is long."""
    half = _LONGEST // 2
    return text if len(text) <= _LONGEST else f"{text[:half]}...{text[-half:]}"


def _scalar(value: object) -> object:
    """Unpack a numpy array without axes to the number or name that it holds."""
    return value[()] if isinstance(value, np.ndarray) and value.ndim == 0 else value


def entries(value: object) -> list[Any] | None:
    """Return the items of a list, a tuple, another sequence or an array; None for all else, also text and bytes."""
    if isinstance(value, np.ndarray):
        return list(value) if value.ndim else None
    return list(value) if isinstance(value, Sequence) and not isinstance(value, _TEXTS) else None


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
    """
    given = _scalar(value)
    real = isinstance(given, Real) and not isinstance(given, bool)
    if real:
        try:
            x = float(given)  # type: ignore[arg-type]
        except OverflowError:  # an integer beyond the largest float
            x = math.inf
        within = (above is None or x > above) and (least is None or x >= least) and (most is None or x <= most)
        if within and math.isfinite(x):
            return x
    bounds = {f"> {above}": above, f">= {least}": least, f"<= {most}": most}
    told = [text for text, bound in bounds.items() if bound is not None]
    allowed = " and ".join(["a finite number", *told]) + (f" [{unit}]" if unit else "")
    raise (ValueError if real else TypeError)(f"{name} = {shown(value)}: must be {allowed}")


def integer(name: str, value: object, least: int, most: int | None = None) -> int:
    """Check one integer in [least, most]."""
    allowed = f"an integer >= {least}" if most is None else f"an integer from {least} to {most}"
    given = _scalar(value)
    if isinstance(given, bool) or not isinstance(given, Integral):
        raise TypeError(f"{name} = {shown(value)}: must be {allowed}")
    n = int(given)
    if n < least or (most is not None and n > most):
        raise ValueError(f"{name} = {shown(value)}: must be {allowed}")
    return n


def pair(name: str, value: object, unit: str = "", **bounds: float | None) -> tuple[float, float]:
    """Check two finite numbers, one for each link or joint; bounds as in `number`."""
    values = entries(value)
    if values is None or len(values) != 2:
        raise TypeError(f"{name} = {shown(value)}: must be a pair of numbers" + (f" [{unit}]" if unit else ""))
    first, second = (number(f"{name}[{i}]", x, unit, **bounds) for i, x in enumerate(values))
    return first, second


def instance(name: str, value: object, allowed: type[Any]) -> None:
    """Refuse a value of another class."""
    if not isinstance(value, allowed):
        article = "an" if allowed.__name__[0] in "AEIOU" else "a"
        raise TypeError(f"{name} = {shown(value)}: must be {article} {allowed.__name__}")


def choice(name: str, value: object, allowed: Iterable[str]) -> str:
    """Check that a string option is one of the allowed names."""
    names = list(allowed)
    given = _scalar(value)
    if not isinstance(given, str) or given not in names:
        raise ValueError(f"{name} = {shown(value)}: must be one of {', '.join(map(repr, names))}")
    return str(given)


def finite_array(
    name: str, value: ArrayLike, shape: tuple[int | None, ...], most: float = np.inf
) -> NDArray[np.float64]:
    """Check an array of finite numbers against a shape.

    Args:
        name: for messages.
        value: what the user gave.
        shape: None admits any length on that axis.
        most: largest magnitude of an entry.

    Returns:
        A new float64 array, so that the caller's is never changed.
    """
    array = real_array(name, value)
    if array.ndim != len(shape) or any(n is not None and n != m for n, m in zip(shape, array.shape, strict=True)):
        raise ValueError(f"{name}: must have shape {str(shape).replace('None', 'n')}, got {array.shape}")
    return _finite(name, array, most)


def finite_rows(name: str, value: ArrayLike, last: int, most: float = np.inf) -> NDArray[np.float64]:
    """Check an array of finite numbers whose last axis has a given length, whatever the others; see `finite_array`."""
    array = real_array(name, value)
    if array.ndim == 0 or array.shape[-1] != last:
        raise ValueError(f"{name}: must have shape (..., {last}), got {array.shape}")
    return _finite(name, array, most)


def finite_values(name: str, value: ArrayLike, most: float = np.inf) -> NDArray[np.float64]:
    """Check an array of finite numbers of any shape; see `finite_array`."""
    return _finite(name, real_array(name, value), most)


def _finite(name: str, array: NDArray[np.float64], most: float) -> NDArray[np.float64]:
    inside = np.isfinite(array) if most == np.inf else np.abs(array) <= most
    if not inside.all():
        index = tuple(int(i) for i in np.argwhere(~inside)[0])
        place = str(list(index)) if index else ""
        limit = "" if most == np.inf else f", at most {most:g} in magnitude"
        raise ValueError(f"{name}{place} = {array[index]}: must be finite{limit}")
    return array


def real_array(name: str, value: ArrayLike) -> NDArray[np.float64]:
    """Check an array of real numbers of any shape; strings, booleans, complex numbers and ragged lists are refused.

    Returns:
        A new float64 array.
    """
    try:
        array = np.asarray(value)
    except Exception as error:  # numpy calls methods of the value, which may raise anything
        raise ValueError(f"{name}: must be an array of real numbers ({short(str(error))})") from None
    if array.dtype.kind not in "iuf" or isinstance(value, _TEXTS):
        raise ValueError(f"{name} = {shown(value)}: must be an array of real numbers")
    if array.dtype == np.float64:
        return array.copy()
    with np.errstate(over="ignore"):  # wider floats than ours become infinite, as their text would
        return array.astype(np.float64)


def listed(name: str, value: object) -> list[Any]:
    """Check that an option is a list or tuple."""
    found = entries(value)
    if found is None:
        raise TypeError(f"{name} = {shown(value)}: must be a list or a tuple")
    return found


def names(name: str, value: object) -> tuple[str, ...]:
    """Check that an option is a list of different names."""
    found = listed(name, value)
    if not all(isinstance(entry, str) for entry in found):
        raise TypeError(f"{name} = {shown(value)}: must hold names")
    if not found or len(set(found)) < len(found):
        raise ValueError(f"{name} = {shown(value)}: must hold at least one name, and each only once")
    return tuple(map(str, found))


def function(name: str, value: object) -> Any:
    """Check that an option can be called, or raise `TypeError`."""
    if not callable(value):
        raise TypeError(f"{name} = {shown(value)}: must be a function")
    return value


def known_names(owner: str, given: Iterable[str], known: Sequence[str]) -> None:
    """Check the names of keyword arguments.

    Args:
        owner: name of the class that was given them.
        given: the names that the user gave.
        known: all names that are allowed.

    Raises:
        TypeError: for the first that is not known, with the nearest known ones. It begins as Python's own message,
            which libraries look for (TorchRL tries `frameskip` on every environment).
    """
    for name in given:
        if name not in known:
            near = " or ".join(map(repr, nearest_names(name, known)))
            hint = f"did you mean {near}?" if near else f"see help({owner})"
            raise TypeError(f"{owner}.__init__() got an unexpected keyword argument {shown(name)}; {hint}")


def nearest_names(name: str, known: Sequence[str]) -> list[str]:
    """Return names that a user may have meant: those made of words of this one, and the one spelt most alike."""
    words = name.split("_")
    within = [other for other in known if set(other.split("_")) <= set(words)]
    within.sort(key=lambda other: not other.endswith(words[-1]))  # `delay` before `sensor` for `sensor_delay`
    return list(dict.fromkeys([*within, *difflib.get_close_matches(name, known, 1)]))


def mapping(name: str, value: object) -> dict[str, Any]:
    """Check that an option is a mapping."""
    if not isinstance(value, Mapping):
        raise TypeError(f"{name} = {shown(value)}: must be a mapping of names")
    return dict(value)


def flag(name: str, value: object) -> bool:
    """Check that an option is True or False."""
    given = _scalar(value)
    if not isinstance(given, bool | np.bool_):
        raise TypeError(f"{name} = {shown(value)}: must be True or False")
    return bool(given)

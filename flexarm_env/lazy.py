"""`cached_property` without a lock."""

from __future__ import annotations

import functools
import sys
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING or sys.version_info >= (3, 12):
    from functools import cached_property
else:

    class cached_property(functools.cached_property):  # noqa: N801  (its own name)
        """Works like functools' of Python 3.12 and later.

        Before, functools' holds one lock for all objects while it computes a value. A process that another thread forks
        meanwhile inherits the lock as taken, and nothing releases it there.
        """

        def __get__(self, instance: Any, owner: type | None = None) -> Any:
            """Compute the value and put it into the object's `__dict__`, where Python looks first."""
            if instance is None:
                return self
            value = instance.__dict__[self.attrname] = self.func(instance)
            return value


__all__ = ["cached_property"]

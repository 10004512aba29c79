"""`versions`: what a training's result depends on beside its configuration."""

from __future__ import annotations

import platform
from collections.abc import Collection, Iterable
from functools import cache
from importlib.metadata import version

from flexarm_agents.code_version import code_version

LIBRARIES = ("numpy", "numba", "torch", "stable_baselines3", "sb3_contrib", "gymnasium")
WITHOUT_PART = ("flexarm_agents.commands", "flexarm_env.envs.rendering", "flexarm_env.envs.documentation")


def versions(modules: Iterable[str], without: Collection[str] = WITHOUT_PART) -> dict[str, str]:
    """Return the versions of Python and the libraries, and the hash of the code (`code_version`).

    Args:
        modules: that train; all that they import counts.
        without: see `code_version`.
    """
    return {"python": platform.python_version(), "code": _code(tuple(modules), tuple(without))} | {
        name: version(name) for name in LIBRARIES
    }


@cache
def _code(modules: tuple[str, ...], without: tuple[str, ...]) -> str:
    return code_version(modules, without)

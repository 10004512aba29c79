"""Keep the results of long computations on disk: an interrupted `make validate` goes on where it was.

A result holds for the sources, plans, policies and libraries that it was made with; others are deleted.
"""

import hashlib
import pickle
import platform
import shutil
from collections.abc import Callable
from functools import cache, wraps
from importlib.metadata import distributions
from pathlib import Path
from typing import ParamSpec, TypeVar

from flexarm_agents.files import put

P, R = ParamSpec("P"), TypeVar("R")
ROOT = Path(__file__).resolve().parents[2]
FOLDER = ROOT / "results" / "validation" / "kept"
SOURCES = ("flexarm_env", "baselines", "agents", "tests/validation")
SUFFIXES = (".py", ".npz", ".json")
LIBRARIES = ("numpy", "scipy", "numba", "mujoco", "exudyn")


@cache
def _folder() -> Path:
    digest = hashlib.sha256(platform.python_version().encode())
    there = {one.name: one.version for one in distributions()}
    digest.update(repr([there.get(library) for library in LIBRARIES]).encode())
    for path in sorted(path for name in SOURCES for path in (ROOT / name).rglob("*") if path.suffix in SUFFIXES):
        digest.update(str(path.relative_to(ROOT)).encode() + path.read_bytes())
    folder = FOLDER / digest.hexdigest()[:16]
    for other in FOLDER.glob("*"):
        if other != folder:
            shutil.rmtree(other, ignore_errors=True)
    folder.mkdir(parents=True, exist_ok=True)
    return folder


def kept(function: Callable[P, R]) -> Callable[P, R]:
    """Keep what a function returns; calls whose arguments have the same `repr` are the same."""
    known: dict[str, R] = {}

    @wraps(function)
    def found(*args: P.args, **kwargs: P.kwargs) -> R:
        call = f"{function.__module__}.{function.__name__} {args} {sorted(kwargs.items())}"
        if call not in known:
            path = _folder() / f"{hashlib.sha256(call.encode()).hexdigest()}.pkl"
            if not path.exists():
                result = function(*args, **kwargs)
                put(path, lambda aside: aside.write_bytes(pickle.dumps(result)))
            known[call] = pickle.loads(path.read_bytes())
        return known[call]

    return found

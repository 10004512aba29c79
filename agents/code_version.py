"""`code_version`: a hash of the source on which a result depends, so that no other commit makes it stale.

The source is that of a module and of all that it imports, as far as it is ours or lies beside the module. Comments,
docstrings and layout do not count. Other libraries do not count either; a board names their versions.
"""

from __future__ import annotations

import ast
import hashlib
import importlib.util
from collections.abc import Collection, Iterable, Iterator, Mapping
from functools import cache, lru_cache
from pathlib import Path
from typing import Any, NamedTuple

PACKAGES = ("flexarm_env", "flexarm_baselines", "flexarm_agents")
# Data that a module reads from its package.
DATA = {"flexarm_baselines.optimal.plan": "plans/*.npz", "flexarm_baselines.lqg.race": "plans/races/*.npz"}
# The same with the shipped policies; the board leaves them out, since each entry names its own policy's file.
WITH_POLICIES = {**DATA, "flexarm_agents.policies.load": "policies/*.npz"}


def code_version(modules: Iterable[str], without: Collection[str] = (), data: Mapping[str, str] = DATA) -> str:
    """Return a hash of modules, of all that they import, and of the data that these read.

    Args:
        modules: their names.
        without: names of modules and packages that do not count, nor what they alone import.
        data: by the name of a module, the pattern of the files that it reads, from the folder of its top package.

    Raises:
        ImportError: if there is no such module, or it has no source.
    """
    return _version(tuple(modules), frozenset(without), tuple(sorted(data.items())))


@lru_cache
def _version(modules: tuple[str, ...], without: frozenset[str], data: tuple[tuple[str, str], ...]) -> str:
    digest = hashlib.sha256()
    for name in sorted(_closure(modules, without)):
        digest.update(f"{name} {_source(name).hash}\n".encode())
        for path in _data(name, dict(data)):
            digest.update(f"{path.name} {file_hash(path)}\n".encode())
    return digest.hexdigest()[:32]


def file_hash(path: Path) -> str:
    """Return the hash of a file's content."""
    return hashlib.sha256(path.read_bytes()).hexdigest()[:32]


@lru_cache
def _closure(modules: tuple[str, ...], without: frozenset[str]) -> frozenset[str]:
    """Return the modules and all that they import."""
    found: set[str] = set()
    waiting = list(modules)
    while waiting:
        name = waiting.pop()
        if name not in found and not any(f"{name}.".startswith(f"{one}.") for one in without):
            found.add(name)
            waiting += _source(name).imports
    return frozenset(found)


class _Source(NamedTuple):
    """What counts of a module's source."""

    imports: tuple[str, ...]  # names of modules
    hash: str


@cache
def _source(name: str) -> _Source:
    tree, folder = _tree(name), _path(name).parent
    package = name if _path(name).name == "__init__.py" else name.rpartition(".")[0]
    imports = sorted(one for one in set(_named(tree, package)) if _counts(one, folder))
    return _Source(tuple(imports), hashlib.sha256(_written(tree).encode()).hexdigest())


def _named(tree: ast.AST, package: str) -> Iterator[str]:
    """Yield the names of the modules that an import may mean: `from a import b` means a.b where that is a module."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (one.name for one in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = node.module or ""
            if node.level:
                above = package.rsplit(".", node.level - 1)[0]
                base = f"{above}.{base}" if base else above
            inner = [f"{base}.{one.name}" for one in node.names]
            yield from inner
            if not all(map(_is_module, inner)):
                yield base


def _counts(name: str, folder: Path) -> bool:
    """Return whether a module's source counts: one of ours, or one that lies beside the module that imports it."""
    if not _is_module(name):
        return False
    path = _path(name)
    return name.partition(".")[0] in PACKAGES or (folder in path.parents and "site-packages" not in path.parts)


@cache
def _is_module(name: str) -> bool:
    try:
        found = importlib.util.find_spec(name)
    except (ImportError, ValueError, AttributeError):
        return False
    return found is not None and found.origin is not None and found.origin.endswith(".py")


def _path(name: str) -> Path:
    found = importlib.util.find_spec(name)
    if found is None or found.origin is None:
        raise ImportError(f"module {name}: there is none, or it has no source")
    return Path(found.origin)


def _tree(name: str) -> ast.Module:
    """Return the syntax tree of a module, without docstrings."""
    tree = ast.parse(_path(name).read_bytes())
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
            first = node.body[0] if node.body else None
            if isinstance(first, ast.Expr) and isinstance(first.value, ast.Constant):
                if isinstance(first.value.value, str):
                    del node.body[0]
    return tree


def _written(node: Any) -> str:
    """Write a syntax tree; fields that are empty, of which each version of Python has others, are left out."""
    if isinstance(node, ast.AST):
        filled = [f"{name}={_written(value)}" for name, value in ast.iter_fields(node) if value is not None]
        return f"{type(node).__name__}({','.join(one for one in filled if not one.endswith('=[]'))})"
    return f"[{','.join(map(_written, node))}]" if isinstance(node, list) else repr(node)


def _data(name: str, data: Mapping[str, str]) -> list[Path]:
    if name not in data:
        return []
    top = _path(name.partition(".")[0]).parent
    return sorted(top.glob(data[name]))

"""Modules under their names of the last release: each still imports, with a warning."""

from __future__ import annotations

import sys
import warnings
from collections.abc import Mapping, Sequence
from importlib import import_module
from importlib.abc import Loader, MetaPathFinder
from importlib.machinery import ModuleSpec
from types import ModuleType


class _RenamedModules(MetaPathFinder, Loader):
    """Finds a module under its old name and fills it with the contents of the new one."""

    def __init__(self, names: Mapping[str, str]) -> None:
        self._names = names

    def find_spec(
        self, fullname: str, path: Sequence[str] | None = None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """Return a spec if the name is an old one."""
        return ModuleSpec(fullname, self) if fullname in self._names else None

    def exec_module(self, module: ModuleType) -> None:
        """Warn, then copy what the module of the new name holds; functions and classes stay the same objects."""
        new = self._names[module.__name__]
        warnings.warn(
            f"{module.__name__} is now {new}; the old name goes with the next release", DeprecationWarning, stacklevel=2
        )
        contents = vars(import_module(new))
        vars(module).update({name: value for name, value in contents.items() if not name.startswith("__")})


def keep_old_names(package: str, names: Mapping[str, str]) -> None:
    """Let old names of a package's modules import, for one release; `names`: the new ones by the old ones."""
    sys.meta_path.append(_RenamedModules({f"{package}.{old}": f"{package}.{new}" for old, new in names.items()}))

"""`needs_extra`: a package that is not installed is named together with the extra that brings it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from flexarm_env.extras import install_hint


@contextmanager
def needs_extra(what: str, extra: str) -> Iterator[None]:
    """Within `with`, an import that fails says what to install.

    Args:
        what: needs the packages that are imported.
        extra: brings them.

    Raises:
        ModuleNotFoundError: naming the extra.
    """
    try:
        yield
    except ModuleNotFoundError as error:
        missing = (error.name or "").partition(".")[0]
        if not missing or missing.startswith("flexarm_"):
            raise
        raise ModuleNotFoundError(f"{what}: {install_hint(missing, extra)}", name=missing) from error

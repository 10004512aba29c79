"""How to install what only some users need."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager


def install_hint(package: str, extra: str) -> str:
    """Write the message for a missing package.

    Args:
        package: its name.
        extra: extra of FlexArm, which brings it.
    """
    return (
        f'{package} is not installed; run `pip install "flexarm[{extra}]"`, '
        f'or `pip install -e ".[{extra}]"` in a clone of FlexArm'
    )


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

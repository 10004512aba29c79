"""How to install what only some users need."""

from __future__ import annotations


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

"""How a script ends where its input is bad: with one line and status 1, not with a traceback."""

from __future__ import annotations

import sys
from collections.abc import Callable


def run(main: Callable[[], None]) -> None:
    """Run a script's `main`; what it says of bad input or of a file becomes the last line."""
    try:
        main()
    except (ValueError, TypeError, OSError) as error:
        sys.exit(f"error: {error}")

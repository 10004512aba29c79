"""How to install what only some users need."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import metadata
from pathlib import Path
from typing import Any

from gymnasium.error import DependencyNotInstalled


def install_hint(package: str, extra: str) -> str:
    """Write the message for a missing package, and the extra of FlexArm that brings it."""
    return f"{package} is not installed; run `{install_command(extra)}`"


def install_command(extra: str, package: Path | None = None) -> str:
    """Return the command that brings an extra to this installation: to the clone, or from where it was installed.

    `package`: the folder of `flexarm_env`, if it is another than this one.
    """
    clone = (package or Path(__file__).resolve().parent).parent
    if (clone / "pyproject.toml").is_file():
        return f'pip install -e "{clone}[{extra}]"'
    return f'pip install "flexarm[{extra}]{_source()}"'


def _source() -> str:
    """Return ` @ URL` if FlexArm was installed from a file, a folder or a repository; nothing if from an index."""
    try:
        text = metadata.distribution("flexarm").read_text("direct_url.json")
    except metadata.PackageNotFoundError:
        return ""
    if text is None:
        return ""
    found = json.loads(text)
    vcs = found.get("vcs_info")
    return f" @ {vcs['vcs']}+{found['url']}@{vcs['commit_id']}" if vcs else f" @ {found['url']}"


@contextmanager
def needs_extra(what: str, extra: str) -> Iterator[None]:
    """Turn a failed import within `with` into an error: `what` needs packages that an extra of FlexArm brings.

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


class PygameNotInstalledError(DependencyNotInstalled, ImportError):
    """pygame is missing: Gymnasium's error and Python's in one, so that code that expects either of them catches it."""


def import_pygame() -> Any:
    """Import pygame, which prints nothing.

    Raises:
        PygameNotInstalledError: if it is missing, naming the extra.
    """
    os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")  # a library does not print
    try:
        import pygame
    except ImportError as error:
        raise PygameNotInstalledError(install_hint("pygame", "render")) from error
    return pygame

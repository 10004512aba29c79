"""Write `flexarm_env.envs.option_types` from the declarations of `Options`: what editors and type checkers read."""

from __future__ import annotations

import re
from dataclasses import fields
from pathlib import Path

from flexarm_env.envs import options
from scripts.common.command_line import run

FILE = Path(options.__file__).with_name("option_types.py")
HEAD = '''"""`EnvOptions`: the options as keyword arguments, for editors and type checkers.

Written by `python -m scripts.docs.option_types`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Literal, TypedDict

from flexarm_env.envs.choices import Frame, Start
from flexarm_env.parameters import Compensation, Corner, Delayed, RateJacobian, SensorModel


class EnvOptions(TypedDict, total=False):
    """Options of an environment, all of them optional; see `flexarm_env.envs.options.Options`."""

'''


def text() -> str:
    """Return the module. Where an option keeps a tuple, a list is as good."""
    declared = "".join(f"    {one.name}: {one.type}\n" for one in fields(options.Options))
    return HEAD + re.sub(r"tuple\[(\w+), [^]]*", r"Sequence[\1", declared).replace("'", '"')


def main() -> None:
    """Command line."""
    FILE.write_text(text(), encoding="utf-8")


if __name__ == "__main__":
    run(main)

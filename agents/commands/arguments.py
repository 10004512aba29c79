"""Arguments that several verbs share."""

import argparse
import json
import shutil
import sys
import textwrap
from collections.abc import Sequence
from difflib import get_close_matches
from typing import Any

EXAMPLES = {
    "list": ("flexarm list",),
    "show": ("flexarm show Square-v0", "flexarm show FlexArm/Paper-v0 | less"),
    "train": (
        "flexarm train --environment Square-v0 --seed 7 --folder runs/mine",
        "flexarm train --environment Square-v0 --seed 7 --folder runs/mine --resume",
        "flexarm train --algorithm sac --environment SquareResidual-v0",
        "flexarm train --initial-policy student_gauges --log-std -2.5 --learning-rate 3e-5 --final-learning-rate 3e-6 "
        "--value-steps 100000",
        "flexarm train --algorithm dagger --environment SquareUnknown-v0 --lags 1 2 4 8 16 32",
        "flexarm train --algorithm fopg --rounds 40 "
        '--options \'{"observation": ["state", "previews", "reference_position"]}\'',
    ),
    "evaluate": (
        "flexarm evaluate runs/mine",
        "flexarm evaluate --policy plan_lqr",
        "flexarm evaluate my_module:MyPolicy --laps 10 --options '{\"noise\": 0.005}'",
    ),
    "render": (
        "flexarm render student",
        "flexarm render lqg --lap plain --output lap.mp4 --save lap.npz",
        "flexarm render runs/mine --output last.png --time 4",
    ),
    "replay": ("flexarm replay lap.npz", "flexarm replay lap.npz --speed 0.25 --output slow.gif --size 400"),
    "play": ("flexarm play", "flexarm play --arm paper --delay 60 --gain 0.5"),
    "identify": ("flexarm identify run.csv --fit payload_mass damping_ratio delay --delay 0.02",),
    "leaderboard": (
        "flexarm leaderboard --entries ifdc joint_pd --columns nominal delay",
        "flexarm leaderboard --entries ifdc --add my_module:MyPolicy",
    ),
    "warm-up": ("flexarm warm-up Square-v0 --num-envs 64",),
}
# Options of the last release, and their names now.
OLD_OPTIONS = {
    "--lesson-options": "--curriculum-options",
    "--lesson-steps": "--curriculum-steps",
    "--rows": "--entries",
}
STATUS = "exit status: 0 done; 1 error, with a message of one line; 2 wrong usage; 128 + its number after a signal"


def epilog(*verbs: str) -> str:
    """Write the end of a help text: examples of verbs, and the meaning of exit statuses."""
    lines = [f"  {line}" for verb in verbs for line in EXAMPLES[verb]]
    return "\n".join(("examples:", *lines, "", wrapped(STATUS)))


def wrapped(paragraph: str) -> str:
    """Wrap a paragraph to the width of the terminal."""
    return textwrap.fill(paragraph, width() - 2)


class Reader(argparse.ArgumentParser):
    """A parser that lists its arguments in `declared`. Options cannot be abbreviated: a new one breaks no command."""

    def __init__(self, prog: str, description: str, epilog: str = "") -> None:
        self.declared: list[argparse.Action] = []
        form = argparse.RawDescriptionHelpFormatter
        about = wrapped(description)
        super().__init__(prog, description=about, epilog=epilog, formatter_class=form, allow_abbrev=False)

    def add_argument(self, *names: str, **given: Any) -> argparse.Action:
        """See `argparse.ArgumentParser.add_argument`."""
        action = super().add_argument(*names, **given)
        self.declared.append(action)
        return action

    def parse_args(self, args: Sequence[str] | None = None, namespace: Any = None) -> Any:  # type: ignore[override]
        """See `argparse.ArgumentParser.parse_args`; the message about an unknown option names a similar one."""
        present = map(_present, sys.argv[1:] if args is None else args)
        given, unknown = self.parse_known_args(list(present), namespace)
        if unknown:
            options = [option for one in self.declared for option in one.option_strings]
            similar = [option for one in unknown for option in get_close_matches(one, options, 1)]
            hint = f"; did you mean {', '.join(similar)}?" if similar else ""
            self.error(f"unrecognized arguments: {' '.join(unknown)}{hint}")
        return given


def _present(argument: str) -> str:
    """Replace an option of the last release, with a warning on stderr."""
    name, equals, value = argument.partition("=")
    if name not in OLD_OPTIONS:
        return argument
    now = OLD_OPTIONS[name]
    print(f"{name} is now {now}; the old name goes with the next release", file=sys.stderr)
    return f"{now}{equals}{value}"


def of_verb(verb: str, description: str) -> Reader:
    """Make the parser of a verb."""
    return Reader(f"flexarm {verb}", description, epilog(verb))


def json_object(text: str) -> dict[str, Any]:
    """Read a JSON object; another text is a `ValueError`."""
    try:
        value = json.loads(text)
    except ValueError as error:
        raise ValueError(f"{text}: not JSON ({error})") from None
    if not isinstance(value, dict):
        raise ValueError(f"{text}: must be a JSON object")
    return value


def json_argument(text: str) -> dict[str, Any]:
    """Read an argument that is a JSON object."""
    try:
        return json_object(text)
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from None


def add_options(parser: argparse.ArgumentParser, what: str) -> None:
    """Add the argument `--options`, environment options as JSON."""
    about = f'{what}, e.g. {{"noise": 0.005}}'
    parser.add_argument("--options", type=json_argument, default={}, metavar="JSON", help=about)


def width() -> int:
    """Return the width of a line of the terminal, 40 at least; 100 where there is none."""
    return max(shutil.get_terminal_size((100, 24)).columns, 40)

"""`flexarm`: the command, with a module for each of its verbs."""

import argparse
import sys
from collections.abc import Sequence
from importlib import import_module
from types import ModuleType
from typing import Any

from flexarm_agents.commands.arguments import epilog
from flexarm_agents.commands.ending import importing, run

VERBS = {
    "list": ("listing", "the environments, policies and controllers that come with the package"),
    "show": ("show", "the specification of an environment: spaces, reward, ends, options"),
    "evaluate": ("evaluate", "score controllers and trained policies on the two standard laps"),
    "leaderboard": ("leaderboard", "measure controllers and policies on every axis of the leaderboard"),
    "render": ("render", "show an episode of a policy in a window, or write a picture or film (extra `render`)"),
    "replay": ("replay", "show a recorded run in a window, or write a picture or film (extra `render`)"),
    "play": ("play", "move delay, sensor and gain while the paper's law runs (extra `render`)"),
    "identify": ("identify", "fit parameters of an arm, and delays, to recorded torques and readings"),
    "train": ("train", "train an agent: by reward, by a teacher, by derivatives (needs the extra `train`)"),
    "warm-up": ("warm_up", "compile what environments need, for images and clusters"),
}
# Verbs of the last release, and what they are now.
OLD_VERBS = {"teach": ["train", "--algorithm", "dagger"], "descend": ["train", "--algorithm", "fopg"]}


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command with some arguments, or this process's; it ends with `SystemExit` unless all went well."""
    longest = max(map(len, VERBS))
    verbs = "\n".join(f"  {verb:<{longest}}  {text}" for verb, (_, text) in VERBS.items())
    parser = argparse.ArgumentParser(
        prog="flexarm",
        usage="flexarm VERB [ARGUMENTS]",
        description=f"Environments of a flexible two-link arm, by the command line.\n\nverbs:\n{verbs}",
        epilog=f"`flexarm VERB --help` shows more.\n\n{epilog(*VERBS)}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action=_Version, nargs=0, help="show the version and exit")
    parser.add_argument("verb", choices=(*VERBS, *OLD_VERBS), metavar="VERB", help=argparse.SUPPRESS)
    rest = parser.add_argument("arguments", nargs=argparse.REMAINDER, help=argparse.SUPPRESS)
    rest.required = False  # which changes the message about a missing verb alone
    given = parser.parse_args(arguments)
    name, *more = OLD_VERBS.get(given.verb, [given.verb])

    def verb() -> None:
        if more:
            now = " ".join(("flexarm", name, *more))
            print(f"flexarm {given.verb} is now `{now}`; the old verb goes with the next release", file=sys.stderr)
        _imported(name).run([*more, *given.arguments])

    run(verb)


class _Version(argparse.Action):
    """Shows the version: argparse's own action would have it imported for every verb's help."""

    def __call__(self, parser: argparse.ArgumentParser, *unused: Any) -> None:
        with importing():
            from flexarm_env import __version__
        print(f"flexarm {__version__}")
        parser.exit()


def _imported(verb: str) -> ModuleType:
    with importing():
        from flexarm_env.extras import needs_extra  # imports all of flexarm_env

        with needs_extra(f"flexarm {verb}", "train"):
            return import_module(f"{__name__}.{VERBS[verb][0]}")

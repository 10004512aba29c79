"""`flexarm replay`: a recorded run, in a window or as a file."""

import argparse
from collections.abc import Sequence
from pathlib import Path

from flexarm_agents.commands.arguments import Reader, of_verb
from flexarm_agents.commands.progress import progress_bar
from flexarm_agents.viewer.film import SUFFIXES, Film, check_look, check_output
from flexarm_env.envs.window import open_display
from flexarm_env.extras import import_pygame
from flexarm_env.simulation.trajectory import Trajectory

DESCRIPTION = """\
Show a recorded run in a window, where space pauses and the right arrow goes on by one picture, or write it to a file. A
run is what flexarm_env.Trajectory.save wrote: by `flexarm render --save`, by run_policy, or by `make reproduce`."""


def parser() -> Reader:
    """Return the parser of the arguments."""
    reader = of_verb("replay", DESCRIPTION)
    reader.add_argument("run", type=Path, metavar="RUN", help="npz file of the run")
    add_film(reader)
    return reader


def run(arguments: Sequence[str]) -> None:
    """Show or write the run."""
    given = parser().parse_args(arguments)
    check_film(given)
    play(Trajectory.load(given.run), given)


def add_film(parser: argparse.ArgumentParser) -> None:
    """Add the arguments that say how a run is shown."""
    output = f"write this file ({', '.join(SUFFIXES)}; moving ones need the extra `video`) in place of a window"
    parser.add_argument("--output", type=Path, metavar="FILE", help=output)
    parser.add_argument("--fps", type=int, default=25, metavar="N", help="pictures a second; 25")
    speed = "speed of the motion; 0.25 is four times slower; 1"
    parser.add_argument("--speed", type=float, default=1.0, metavar="X", help=speed)
    parser.add_argument("--size", type=int, default=600, metavar="N", help="side of a picture [px]; 600")
    parser.add_argument("--time", type=float, metavar="S", help="moment that a .png shows [s]; the last one")


def check_film(given: argparse.Namespace) -> None:
    """Check arguments of `add_film`, as far as that needs no run, and that what they need is there."""
    check_look(given.fps, given.speed, given.size)
    if given.output is not None:
        check_output(given.output, given.fps, given.time)
        return
    if given.time is not None:
        raise ValueError(f"time = {given.time:g} s: is for a .png file, see --output")
    open_display(import_pygame())


def play(played: Trajectory, given: argparse.Namespace) -> None:
    """Show a run in a window, or write it."""
    film = Film(played, given.fps, given.speed, given.size)
    if given.output is None:
        film.show()
        return
    with progress_bar(1 if given.output.suffix.lower() == ".png" else len(film), "pictures") as bar:
        film.write(given.output, given.time, bar.update)
    print(f"{given.output}: written")

"""`flexarm render`: an episode of a policy or controller, in a window or as a file."""

import argparse
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from flexarm_agents.commands.arguments import Reader, of_verb
from flexarm_agents.commands.progress import Watched, episode_steps, progress_bar
from flexarm_agents.commands.replay import add_film, check_film, play
from flexarm_agents.commands.sources import POLICY, add_environment, check_environment, from_source
from flexarm_agents.evaluation.candidates import ENVIRONMENT, Candidate
from flexarm_agents.evaluation.races import FINISHED, OUT_OF_TIME
from flexarm_agents.evaluation.scoring import COMPLETE
from flexarm_agents.files import check_place
from flexarm_agents.viewer.film import SENSOR, check_pictures
from flexarm_env.laps import LAPS
from flexarm_env.rollout import run_policy
from flexarm_env.simulation.trajectory import Trajectory
from flexarm_env.validation import integer

OWN = "own"
DESCRIPTION = """\
Run an episode of a policy or a controller, and show it in a window, where space pauses, or write it to a file.
--save keeps the run itself, for `flexarm replay` and `flexarm_env.Trajectory.load`."""


def parser() -> Reader:
    """Return the parser of the arguments."""
    reader = of_verb("render", DESCRIPTION)
    reader.add_argument("policy", metavar="POLICY", help=POLICY)
    lap = f"standard lap, {' or '.join(LAPS)}, or {OWN}: a start that the environment draws; swing"
    reader.add_argument("--lap", choices=(*LAPS, OWN), default="swing", help=lap)
    reader.add_argument("--seed", type=int, default=0, metavar="N", help="seed of the episode; 0")
    reader.add_argument("--save", type=Path, metavar="FILE", help="keep the run in this npz file")
    add_environment(reader, f"{ENVIRONMENT}, and for trainings that which they were trained in")
    add_film(reader)
    return reader


def run(arguments: Sequence[str]) -> None:
    """Run the episode, show or write it."""
    reader = parser()
    given = reader.parse_args(arguments)
    if given.save is not None and given.save.suffix != ".npz":
        reader.error(f"--save: must end in .npz, got {given.save}")
    check_environment(reader, given, [given.policy])
    integer("seed", given.seed, 0)
    if given.save is not None:
        check_place("save", given.save)
    check_film(given)
    candidate = from_source(given.policy, given, own=True)
    try:
        steps = episode_steps(candidate.env)
        check_pictures(given.fps, given.speed, steps * candidate.env.unwrapped.control_period)  # type: ignore[attr-defined]
        with progress_bar(steps, "steps") as bar:
            played = episode(candidate._replace(env=Watched(candidate.env, bar.update)), given)
    finally:
        candidate.env.close()
    races = candidate.env.unwrapped.settings.mode.races  # type: ignore[attr-defined]
    print(f"{given.policy}: {'race' if races else f'{given.lap} lap'}, {end_of(played, races)}")
    if given.save is not None:
        played.save(given.save)
        print(f"{given.save}: written")
    play(played, given)


def end_of(played: Trajectory, races: bool) -> str:
    """Say how an episode ended; a race that lasts as long as it may is lost."""
    ended, moment = played.notes["ended"], f"{played.time[-1]:.2f} s"
    if ended == FINISHED:
        return f"finished in {moment}"
    if ended == COMPLETE and not races:
        return "complete"
    return f"ended by {OUT_OF_TIME if ended == COMPLETE else ended} at {moment}"


def episode(candidate: Candidate, given: argparse.Namespace) -> Trajectory:
    """Run an episode as the arguments say; its notes name policy, environment, lap and the sensor's position [m]."""
    start: dict[str, object] = {"options": {}} if given.lap == OWN else {"lap": given.lap}
    found = run_policy(candidate.env, candidate.policy, seed=given.seed, **start)  # type: ignore[arg-type]
    place = candidate.env.unwrapped.settings.sensor_position  # type: ignore[attr-defined]
    about = {"policy": given.policy, "environment": candidate.environment, "lap": given.lap, SENSOR: place}
    return replace(found, notes=found.notes | about)

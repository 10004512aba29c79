"""`flexarm evaluate`: scores of controllers and policies on the two standard laps, as a table and as JSON."""

import argparse
import json
import math
import sys
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from flexarm_agents.board.columns import COLUMNS
from flexarm_agents.commands.arguments import Reader, of_verb
from flexarm_agents.commands.progress import Watched, episode_steps, progress_bar
from flexarm_agents.commands.score_table import Spreads, group_table, lap_table, legend, spreads_of
from flexarm_agents.commands.sources import POLICY, add_environment, check_environment, from_source
from flexarm_agents.commands.sweep import sweep
from flexarm_agents.environments import check_id, make_one
from flexarm_agents.evaluation.candidates import ENVIRONMENT, Candidate, changed, plant_of
from flexarm_agents.evaluation.races import RaceScores, evaluate
from flexarm_agents.evaluation.scoring import Spread, StandardScore, rank
from flexarm_agents.files import check_place, write_json
from flexarm_agents.policies.constant import ConstantPolicy
from flexarm_agents.policies.load import shipped_policies
from flexarm_env.laps import LAPS
from flexarm_env.validation import integer

PAPER = ("ifdc", "flsac")  # controllers that are scored by default
DESCRIPTION = """\
Score controllers and trained policies on the swing and the plain lap, from rest on the first corner, by the distance of
the true tip from the target. All run on the default arm, that of FlexArm/Square-v0, unless asked for another; a policy
with an arm or a task of its own has a table of its own. A table is in the order of the mean r.m.s. of both laps, with
lost laps last (the leaderboard ranks by the error on unknown arms)."""


class Result(NamedTuple):
    """A candidate, whose environment is closed, and the scores of its laps."""

    candidate: Candidate
    scores: list[StandardScore]

    def plain(self, seed: int) -> dict[str, Any]:
        """Return plain values for a file."""
        one = self.candidate
        laps = [{"seed": seed + n, **score.as_mapping()} for n, score in enumerate(self.scores)]
        return {
            "name": one.name,
            "reads": one.reads,
            "privileged": one.privileged,
            "environment": one.environment,
            "plant": dict(one.plant),
            "options": one.options,
            "config": one.config,
            "laps": laps,
            **_plain(spreads_of(self.scores)),
        }


def run(arguments: Sequence[str]) -> None:
    """Score, print tables, and write a file where one is named."""
    given = _read(arguments)
    if given.output is not None:
        check_place("output", given.output)
    found = _scored(given) if given.sweep is None else sweep(given)
    if given.output is not None:
        write_json(given.output, found)
        print(f"{given.output}: written")


def _scored(given: argparse.Namespace) -> dict[str, Any]:
    """Score the policies, print their tables, and return plain values for a file."""
    laps, seed = integer("laps", given.laps, 1), integer("seed", given.seed, 0)
    candidates = list(_candidates(given))  # all of them before the first lap, so that a bad name is refused at once
    if not candidates:
        raise ValueError("policies: nothing to score; name one, or leave --baselines or --shipped on")
    results = []
    for candidate in candidates:
        scores = _scores(candidate, laps, seed)
        results.append(Result(candidate, scores))
        what = "race finished" if isinstance(scores[0], RaceScores) else "both laps complete"
        result = str(scores[0]) if laps == 1 else f"{what} with {sum(s.complete for s in scores)} of {laps} seeds"
        print(f"{candidate.name}: {result}", file=sys.stderr, flush=True)
    results.sort(key=lambda result: rank(result.scores))
    plants: dict[str, list[Result]] = {}
    for each in results:
        plants.setdefault(_plant(each.candidate.environment, each.candidate.plant), []).append(each)
    print(legend(laps))
    # the square's first, of which the nominal one has the shortest name
    for plant in sorted(plants, key=lambda plant: (not plant.startswith("Square"), len(plant))):
        print(f"\n{lap_table(plant, [(each.candidate.name, each.scores) for each in plants[plant]])}")
    groups = _groups(results) if given.pool else []
    if groups:
        print(f"\n{group_table([(', '.join(names), spreads) for names, spreads in groups])}")
    if not (given.own or given.environment or given.options or given.arm):
        _print_own(results)
    about = {"seed": seed, "laps": laps, "options": given.options, "arm": given.arm}
    settings = [{"trainings": names} | _plain(spreads) for names, spreads in groups]
    return about | {"results": [each.plain(seed) for each in results], "settings": settings}


def _plant(environment: str, plant: Mapping[str, Any]) -> str:
    return environment.partition("/")[2] + (f" with {json.dumps(plant)}" if plant else "")


def _print_own(results: Sequence[Result]) -> None:
    """Print the policies that were trained on another plant than the one on which they are scored."""
    others = []
    for each in results:
        one = each.candidate
        if one.config is not None:
            own = _plant(one.config["environment"], plant_of(one.config["options"]))
            if own != _plant(one.environment, one.plant):
                others.append(f"{one.name} on {own}")
    if others:
        print(f"\nTrained elsewhere, where --own scores them: {'; '.join(others)}")


def _scores(candidate: Candidate, laps: int, seed: int) -> list[StandardScore]:
    try:
        with progress_bar(laps * len(LAPS) * episode_steps(candidate.env), "steps") as bar:
            env = Watched(candidate.env, bar.update)
            return [evaluate(env, candidate.policy, seed + n) for n in range(laps)]
    except (TypeError, ValueError) as error:
        raise ValueError(f"{candidate.name}: {error}") from error
    finally:
        candidate.env.close()


def parser() -> Reader:
    """Return the parser of the arguments."""
    reader = of_verb("evaluate", DESCRIPTION)
    reader.add_argument("policies", nargs="*", default=[], metavar="POLICY", help=POLICY)
    switch = argparse.BooleanOptionalAction
    alone = "score this one, as POLICY, without the baselines and shipped policies; may be repeated"
    reader.add_argument("--policy", action="append", default=[], metavar="POLICY", help=alone)
    baselines = f"score {', '.join(PAPER)}, no torque and random torque; the default without --policy"
    reader.add_argument("--baselines", action=switch, help=baselines)
    shipped = "score all shipped policies; the default without --policy"
    reader.add_argument("--shipped", action=switch, help=shipped)
    reader.add_argument(
        "--laps", type=int, default=1, metavar="N", help="run both laps with N seeds, from --seed on; 1"
    )
    reader.add_argument("--seed", type=int, default=0, metavar="N", help="seed of the first lap of each kind; 0")
    add_environment(reader, ENVIRONMENT)
    own = "run trained policies in the environments that they were trained in, each with a table of its own"
    reader.add_argument("--own", action="store_true", help=own)
    pool = "also pool trainings that differ in their seeds alone"
    reader.add_argument("--pool", action="store_true", help=pool)
    swept = f"run POLICY along an axis of the leaderboard, with its seeds: {', '.join(COLUMNS)}"
    reader.add_argument("--sweep", metavar="AXIS", help=swept)
    reader.add_argument("--output", type=Path, metavar="FILE", help="write all figures here as JSON")
    return reader


def _read(arguments: Sequence[str]) -> argparse.Namespace:
    reader = parser()
    given = reader.parse_args(arguments)
    given.policies += given.policy
    for group in ("baselines", "shipped"):
        if given.sweep is not None and getattr(given, group):
            reader.error(f"--{group}: cannot go with --sweep, which runs POLICY alone")
        if getattr(given, group) is None:
            setattr(given, group, not given.policy)
    check_environment(reader, given, given.policies)
    if given.own and given.environment is not None:
        reader.error("--own: cannot go with --environment")
    return given


def _candidates(given: argparse.Namespace) -> Iterator[Candidate]:
    names = [*PAPER] if given.baselines else []
    for name in dict.fromkeys((*names, *(shipped_policies() if given.shipped else ()), *given.policies)):  # each once
        yield from_source(name, given, given.own)
    if given.baselines:
        environment, options = check_id(given.environment or ENVIRONMENT), changed({}, given.options, given.arm)
        for name, spread in (("no torque", 0.0), ("random torque", 1.0)):
            env = make_one(environment, options)
            policy = ConstantPolicy(math.prod(env.action_space.shape or ()), spread, given.seed)
            yield Candidate(name, policy, env, environment, options, plant=plant_of(options))


def _groups(results: Sequence[Result]) -> list[tuple[list[str], Spreads]]:
    """Return the trainings that differ in their seeds alone, with the spreads over them of their laps' medians."""
    members: dict[str, list[Result]] = {}
    for each in results:
        if each.candidate.config is not None:
            setting = {name: value for name, value in each.candidate.config.items() if name != "seed"}
            members.setdefault(json.dumps(setting, sort_keys=True), []).append(each)
    groups = []
    for found in members.values():
        if len(found) > 1:
            each_spreads = [spreads_of(each.scores) for each in found]
            spreads = {
                lap: {name: Spread.of(one[lap][name].median for one in each_spreads) for name in figures}
                for lap, figures in each_spreads[0].items()
            }
            groups.append(([each.candidate.name for each in found], spreads))
    return groups


def _plain(spreads: Spreads) -> dict[str, Any]:
    return {lap: {name: spread._asdict() for name, spread in figures.items()} for lap, figures in spreads.items()}

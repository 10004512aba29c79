"""The tables of the pages about agents that show the shipped ones' scores."""

from collections.abc import Iterable, Mapping
from typing import Any

from flexarm_agents import Score, StandardScore, Trained, evaluate, load_policy
from flexarm_agents.board.entries import Entry
from flexarm_agents.commands.score_table import pair
from flexarm_agents.environments import make_one
from flexarm_baselines import FLSAC, IFDC
from flexarm_env.laps import LAPS
from scripts.common.markdown import table
from scripts.common.spreads import millimetres
from scripts.shipped.agents import AGENTS

GAIN = "FlexArm/SquareGain-v0"
ERRORS = ("r.m.s. [mm]", "after 2 s [mm]", "maximum [mm]")


def scores(names: Iterable[str]) -> str:
    """Tabulate the nominal scores of the square's shipped agents and of the paper's controllers."""
    env = make_one(GAIN)
    agents = {name: agent for name in names if not (agent := load_policy(name)).has_own_task}
    found = {(AGENTS[name].text, _observed(agent)): _nominal(agent) for name, agent in agents.items()} | {
        ("FLSAC", "`SquareGain-v0`"): evaluate(env, FLSAC.for_env(env)),
        ("IFDC", "`SquareGain-v0`"): evaluate(env, IFDC.for_env(env)),
    }
    details = ("torque change per step [N m]", "elbow changes", "peak deflection [m]", "peak torque [N m]")
    return table(
        ("policy", "environment", f"{'; '.join(LAPS)}: {', '.join(ERRORS)}", *details),
        (
            (policy, environment, *("; ".join(lap) for lap in zip(*map(_cells, score), strict=True)))
            for (policy, environment), score in found.items()
        ),
    )


def _cells(score: Score) -> tuple[str, ...]:
    """Write a lap's errors and details."""
    details = pair(score.torque_change, 1), str(score.elbow_changes), pair(score.peak_deflection, 2)
    return (" / ".join(errors(score)), *details, pair(score.peak_torque, 0))


def _nominal(agent: Trained) -> StandardScore:
    """Score an agent on the nominal plant, or on its own arm, with the observation that it was trained with."""
    if agent.has_own_arm:
        return evaluate(agent.make_env(), agent.policy)
    row = Entry(agent.name).candidate()
    return evaluate(row.env, row.policy)


def _observed(agent: Trained) -> str:
    """Return the id whose plant an agent is scored on here: the default arm with torques, or with the law's gain."""
    name = "SquareGain-v0" if agent.environment == GAIN else "Square-v0"
    return f"`{name}`{', its own arm' * agent.has_own_arm}"


def costs(cards: Mapping[str, dict[str, Any]]) -> str:
    """Tabulate what the trainings of each agent took until their best evaluation."""
    rows = []
    for name, card in cards.items():
        steps, seconds = ([one[what] for one in card["trainings"]] for what in ("steps", "seconds"))
        least = f"{min(seconds) / 60.0:.1f}"
        rows.append((f"`{name}`", str(len(seconds)), f"{min(steps):,} to {max(steps):,}", least))
    return table(("agent", "seeds", "environment steps", "minutes, least of the seeds"), rows)


def errors(score: Score) -> tuple[str, ...]:
    """Write a lap's errors; an early end is marked in each."""
    if not score.complete:
        return (f"lost: {score.ended} after {score.duration:.1f} s", "lost", "lost")
    return tuple(map(millimetres, (score.rms, score.rms_after_2s, score.maximum)))

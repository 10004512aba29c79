"""Nominal laps of the rows as trajectories, for the pictures: cells keep figures only."""

from __future__ import annotations

from collections.abc import Sequence

from flexarm_agents.board.rows import Row
from flexarm_env.laps import LAPS
from flexarm_env.rollout import run_policy
from flexarm_env.simulation.trajectory import Trajectory

Runs = dict[str, dict[str, Trajectory]]  # of each row, of each lap


def nominal_runs(rows: Sequence[Row]) -> Runs:
    """Run both laps of each row once."""
    found: Runs = {}
    for row in rows:
        contender = row.contender(fresh=True)
        found[row.name] = {lap: run_policy(contender.env, contender.policy, seed=0, lap=lap) for lap in LAPS}
        contender.env.close()
    return found

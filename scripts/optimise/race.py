"""Find the best known race: speeds of the reference and torques together, for three laps of the square from rest.

`python -m scripts.optimise.race` begins with speeds that rise and fall evenly between the corners. *Chase*: torques
that keep the tip near the reference are optimised, with a steep cost of distance; then the reference moves towards the
tip, faster where the distance is small and slower where it is large. *Polish*: the race is stretched in time until
torques keep the tip within the limit; instants that are beyond it weigh more and more. `--ship` puts the plan where the
package has it.

`--slower 1.4` makes another plan, "steady", for arms that differ: the beginning's speeds, so many times slower, and
torques that keep the tip near them and leave some for feedback.
"""

import shutil
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.ndimage import gaussian_filter1d, maximum_filter1d

from flexarm_agents.files import put
from flexarm_baselines.arrays import Floats
from flexarm_baselines.lqg.race import RACES
from flexarm_baselines.optimal import GOOD, Branch, Plan, PlanRegulator, TrackingProblem, along, lap_square
from flexarm_baselines.optimal.solver import Search, rollout
from flexarm_env.actions import TORQUE_LIMIT
from flexarm_env.codegen.elementary import sincos
from flexarm_env.formulas import tip
from flexarm_env.parameters import ArmParameters
from flexarm_env.physics.paths import by_distance, square
from flexarm_env.simulation.arm import FlexibleArm
from flexarm_env.simulation.feedback import Rollout
from flexarm_env.simulation.limits import rest_state
from flexarm_env.validation import integer, number
from scripts.common.command_line import read_options, run

PERIOD, SPEED, ACCELERATION = 0.01, 25.0, 90.0  # [s, m/s, m/s^2]; the environment allows a little more acceleration
START = (3.0, 15.0, 13.0, 18.0)  # at corners [m/s], between them and on the first side [m/s^2], at most [m/s]
AIM, LIMIT = 0.24, 0.2455  # [m], of the distance; a race is lost at 0.25
DEFLECTION, BENT = 1.25, 1.47  # [m], from which bending costs, and comes too near the 1.5 at which a race is lost
BOUND = 0.21  # [m]; distance at which the steep cost is 1 in its unit
BEYOND = 1.5  # [m] that a plan goes on after the race, so that its end costs nothing
STRETCHES = (1.03, 1.04, 1.05, 1.06, 1.08, 1.1)
# Of the steady plan: share of the torques, links' deflection from which bending costs [m], and the solver's iterations.
SPARING, UNBENT, ITERATIONS = 0.75, 0.9, 30


@dataclass
class Options:
    """Find the best known race."""

    output: Path = Path("results/optimise/race")
    """Folder for the plan."""
    passes: int = 200
    """Moves of the reference."""
    rounds: int = 120
    """Rounds in which weights change, for each stretch of time."""
    slower: float = 0.0
    """How much slower than `START` the steady plan is, which is then made in the place of the best one."""
    ship: bool = False
    """Copy the plan to baselines/plans."""


class Race:
    """The race, and what its plans are measured by."""

    def __init__(self) -> None:
        """Take the plain lap's square and the default arm."""
        self.arm, task = FlexibleArm(ArmParameters.named("default")), lap_square("plain")
        self.path, self.branch = by_distance(square(task)), task.elbow_branch
        self.length = 3.0 * self.path.lap_time

    def problem(self, ways: Floats, weights: Floats) -> TrackingProblem:
        """Return the problem of being near a reference that has come so far at each instant [m]. Shape (n + 1,)."""
        reference, scale = self.path.position(ways), 0.1 * np.sqrt(weights)

        def steep(state: Sequence[Any], time: Any) -> list[Any]:
            at = tip(self.arm, state, lambda x: sincos(x)[0], lambda x: sincos(x)[1])
            off = [(at[axis] - reference[:, axis]) * (1.0 / BOUND) for axis in (0, 1)]
            square_of_it = off[0] * off[0] + off[1] * off[1]
            return [square_of_it * square_of_it * scale]

        return self.near(ways, tip_weights=0.1, change_weight=1e-6, deflection_limit=DEFLECTION, residuals=steep)

    def off(self, problem: TrackingProblem, found: Rollout) -> Floats:
        """Return the tip's way from the reference at each instant [m]. Shape (n + 1, 2)."""
        return np.stack(tip(self.arm, list(found.states.T), np.sin, np.cos), axis=-1) - problem.reference

    def last(self, ways: Floats) -> int:
        """Return the instant at which the race is over."""
        return int(np.searchsorted(ways, self.length))

    def near(self, ways: Floats, **own: Any) -> TrackingProblem:
        """Return the problem of being as near to a reference as one can, or what else its fields say."""
        reference = self.path.position(ways)
        return TrackingProblem(self.arm, rest_state(self.arm, reference[0], self.branch), reference, **own)

    def start(self, problem: TrackingProblem) -> Rollout:
        """Return where the solution of a problem begins."""
        return along(problem, (Branch(0.0, self.branch),))

    def begin(self, slower: float = 1.0) -> Floats:
        """Return the ways of `START`, with speeds that many times lower."""
        corner, even, first, most = np.array(START) / slower ** np.array((1.0, 2.0, 2.0, 1.0))
        ways, side = np.arange(0.0, self.length + 2.0 * BEYOND, 0.005), 0.25 * self.path.lap_time
        within = ways % side
        rise = np.where(ways < side, np.sqrt(2.0 * first * within + 1e-4), np.sqrt(corner**2 + 2.0 * even * within))
        speeds = np.minimum(np.minimum(rise, np.sqrt(corner**2 + 2.0 * even * (side - within))), most)
        times = np.concatenate([[0.0], np.cumsum(0.005 / (0.5 * (speeds[1:] + speeds[:-1])))])
        return self.summed(np.diff(np.interp(np.arange(0.0, times[-1], PERIOD), times, ways)) / PERIOD)

    def summed(self, speeds: Floats) -> Floats:
        """Return ways at speeds [m/s], less where they would change too fast, to `BEYOND` the race."""
        speeds, change = np.minimum(speeds, SPEED), ACCELERATION * PERIOD
        speeds[0] = min(speeds[0], change)
        for n in range(1, len(speeds)):
            speeds[n] = min(speeds[n], speeds[n - 1] + change)
        for n in range(len(speeds) - 2, -1, -1):
            speeds[n] = min(speeds[n], speeds[n + 1] + change)
        ways = np.concatenate([[0.0], PERIOD * np.cumsum(speeds)])
        missing = int(np.ceil(max(self.length + BEYOND - ways[-1], 0.0) / (PERIOD * speeds[-1])))
        ways = np.concatenate([ways, ways[-1] + PERIOD * speeds[-1] * np.arange(1, missing + 1)])
        return ways[: np.searchsorted(ways, self.length + BEYOND) + 1]

    def retimed(self, found: Rollout, before: Floats, ways: Floats) -> Rollout:
        """Run torques with a regulator at other times: those at which the reference was where it is now."""
        old = PERIOD * np.arange(len(before))
        then = np.interp(ways, before, old)
        plan = Plan(self.arm.parameters, *found, self.path.position(before), TORQUE_LIMIT, PERIOD, 1e-3)
        states = np.stack([np.interp(then, old, column) for column in found.states.T], axis=-1)
        torques = np.stack([np.interp(then[:-1], old[:-1], column) for column in found.torques.T], axis=-1)
        gains = PlanRegulator(plan, GOOD).gains
        nearest = np.minimum(np.round(then[:-1] / PERIOD).astype(int), len(gains) - 1)
        feedback = {"gains": np.ascontiguousarray(gains[nearest]), "references": np.ascontiguousarray(states[:-1])}
        return rollout(self.problem(ways, np.ones(len(ways))), torques, **feedback)

    def lap_times(self, ways: Floats) -> list[float]:
        """Return the times of the first lap, of the fastest, and of all [s]."""
        ends = np.interp(self.length / 3.0 * np.arange(4), ways, PERIOD * np.arange(len(ways)))
        return [float(round(x, 4)) for x in (ends[1], np.diff(ends).min(), ends[3])]


def chase(race: Race, passes: int) -> tuple[Floats, Rollout]:
    """Return ways and a run that are fast, and off by a little more than is allowed."""
    ways = race.begin()
    nearest = race.near(ways)
    found = improved(nearest, race.start(nearest), 15)
    for n in range(passes):
        problem = race.problem(ways, np.ones(len(ways)))
        found = improved(problem, found, 5)
        off = race.off(problem, found)
        ahead = gaussian_filter1d(np.sum(off * race.path.velocity(ways), axis=1), 6.0, mode="nearest")
        moved = np.maximum.accumulate(ways + 0.5 * ahead * np.minimum(1.0, np.arange(len(ways)) / 20.0))
        moved += 1e-9 * np.arange(len(ways))
        around = maximum_filter1d(np.linalg.norm(off, axis=1), 51)
        room = np.clip((AIM - gaussian_filter1d(around, 12.0, mode="nearest")) / AIM, -1.0, 1.0)[:-1]
        speeds = gaussian_filter1d(np.maximum(np.diff(moved) / PERIOD, 0.2), 2.0, mode="nearest")
        after = race.summed(speeds * (1.0 + 0.02 * room))
        print(f"chase {n}: {race.lap_times(ways)} s, off by {largest(race, ways, off):.4f} m", flush=True)
        found, ways = race.retimed(found, moved, after), after
    return ways, found


def polish(race: Race, ways: Floats, found: Rollout, rounds: int) -> tuple[Floats, Rollout, float]:
    """Return the stretched ways, the run that stays nearest to them, and by how much it is off at most [m]."""
    best = (ways, found, np.inf)
    for stretch in STRETCHES:
        times = PERIOD * np.arange(len(ways))
        slow = race.summed(
            np.diff(np.interp(np.arange(0.0, stretch * times[-1], PERIOD) / stretch, times, ways)) / PERIOD
        )
        run, weights = race.retimed(found, ways, slow), np.ones(len(slow))
        for n in range(rounds):
            weights[race.last(slow) + 2 :] = 0.01
            problem = race.problem(slow, weights)
            run = improved(problem, run, 5)
            off = race.off(problem, run)
            bent = float(np.abs(race.arm.tip_deflection(run.states[:, : race.arm.size])).max())
            most = largest(race, slow, off) + max(bent - BENT, 0.0)
            best = (slow, run, most) if most < best[2] else best
            print(f"stretch {stretch}, round {n}: {race.lap_times(slow)} s, off by {most:.4f} m", flush=True)
            if most < LIMIT:
                return best
            distance = np.linalg.norm(off, axis=1)
            weights = np.clip(weights * np.where(distance > 0.2, (distance / 0.238) ** 2.5, 1.0), 0.5, 1e4)
    return best


def steady(race: Race, slower: float) -> Plan:
    """Return a plan with torque to spare, so many times slower than `START`."""
    ways, (shoulder, elbow) = race.begin(slower), TORQUE_LIMIT
    limits = SPARING * shoulder, SPARING * elbow
    problem = race.near(ways, limits=limits, change_weight=1e-4, deflection_limit=UNBENT)
    found = improved(problem, race.start(problem), ITERATIONS)
    return plan_of(race, ways, found, largest(race, ways, race.off(problem, found)))


def improved(problem: TrackingProblem, start: Rollout, iterations: int) -> Rollout:
    """Return a run after some iterations of the solver, or after none that helps."""
    search = Search(problem, start)
    for _ in range(iterations):
        if search.improve()[0] == 0.0:
            break
    return search.run


def largest(race: Race, ways: Floats, off: Floats) -> float:
    """Return the largest distance from the reference during the race [m]."""
    return float(np.linalg.norm(off, axis=1)[: race.last(ways) + 1].max())


def plan_of(race: Race, ways: Floats, found: Rollout, most: float) -> Plan:
    """Return the plan of the race's own periods."""
    n = race.last(ways)
    own = found.states[: n + 1], found.torques[:n], race.path.position(ways[: n + 1])
    notes = {"ways": np.round(ways[: n + 1], 9).tolist(), "lap_times": race.lap_times(ways)}
    notes["largest_error"] = round(most, 5)
    return Plan(race.arm.parameters, *own, TORQUE_LIMIT, PERIOD, 1e-3, notes)


def main() -> None:
    """Command line."""
    options, race = read_options("python -m scripts.optimise.race", Options()), Race()
    number("slower", options.slower, least=0.0)
    integer("passes", options.passes, 1)
    integer("rounds", options.rounds, 1)
    options.output.mkdir(parents=True, exist_ok=True)
    if options.slower > 0.0:
        plan, file = steady(race, options.slower), options.output / "steady.npz"
    else:
        plan = plan_of(race, *polish(race, *chase(race, options.passes), options.rounds))
        file = options.output / "default.npz"
    put(file, lambda aside: plan.save(aside, run=False))
    first, fastest, whole = plan.notes["lap_times"]
    print(
        f"first lap {first} s, fastest {fastest} s, all three {whole} s, off by {plan.notes['largest_error']} m at most"
    )
    if options.ship:
        shutil.copyfile(file, RACES / file.name)


if __name__ == "__main__":
    run(main)

"""Runs the episodes of an entry at some points: in batches whose lanes have settings of their own.

A result is the same, to the last bit, whatever other points are run with it: the kernels' lanes do not depend on each
other. Controllers, whose rows do not either (`Entry.independent`), are called once for a whole batch, other policies
once for each point.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import fields
from typing import Any, NamedTuple

import gymnasium
import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag

from flexarm_agents.board.columns import Episode, Point
from flexarm_agents.board.entries import Entry
from flexarm_agents.board.terms import TASKS, BoardTask
from flexarm_agents.evaluation.scoring import COMPLETE
from flexarm_env.envs.base import FlexArmEnvBase
from flexarm_env.envs.per_env import common_values
from flexarm_env.envs.settings import Settings
from flexarm_env.envs.termination import NOT_TERMINATED, end_reason
from flexarm_env.envs.vector import FlexArmVectorEnv
from flexarm_env.laps import LAPS
from flexarm_env.physics.link_modes import LinkModes
from flexarm_env.predictor import Predictor, predictor

Array = NDArray[np.float64]
LANES = 16  # most episodes of a batch: two of the smallest blocks, so that fewer kernels are compiled
NO_ACTION = "action"  # the end of an episode in which the policy's action is not finite
RAISED = "policy"  # the end of an episode in which the policy raises an error
_MODAL = ("modal_coordinates", "modal_rates")
_SHAPES = ("link_lengths", "mode_shapes", "modes_per_link", "mode_scale")
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(24)
_RECORDED = ("time", "state", "true_tip", "reference", "torque")


class _Call(NamedTuple):
    """Episodes whose actions a policy chooses in one call."""

    lanes: slice  # which of the batch
    predict: Predictor  # the policy
    single: bool  # the policy takes one observation, not a batch of one

    def choose(
        self, observations: NDArray[np.float32], matrix: Array | None, memory: Any, start: NDArray[np.bool_]
    ) -> tuple[Any, Any]:
        """Choose the episodes' actions from the whole batch's observations; see `Predictor` and `observation_map`."""
        own = observations[self.lanes].copy()
        if matrix is not None:  # of these alone: a product's rounding errors may depend on how many it has
            own = (own @ matrix.T).astype(np.float32)
        return self.predict(own[0] if self.single else own, memory, start[self.lanes])


def run_points(entry: Entry, points: Sequence[Point]) -> list[dict[str, Any]]:
    """Run an entry at some points.

    Returns:
        A mapping for each point: "episodes", the plain values of each episode (`_outcome`); or "not_applicable", the
        reason why the entry cannot be run there.
    """
    results: list[dict[str, Any]] = [{} for _ in points]
    batches: dict[str, list[int]] = {}
    settings: dict[int, Settings] = {}
    entry.candidate()  # else it is no entry
    for n, point in enumerate(points):
        try:
            settings[n] = Settings.of(point.environment_options(entry.interface))
            entry.candidate(point.task)
            if TASKS[point.task].hosted:
                _hosted(entry, point).close()  # refuses what the other engine cannot do
        except (TypeError, ValueError) as error:
            results[n] = {"not_applicable": str(error)}
            continue
        batches.setdefault(f"{point.task} {common_values(settings[n])!r}", []).append(n)
    for members in batches.values():
        for group in shares([len(points[n].episodes) for n in members]):
            some = [members[k] for k in group]
            found = _run_some(entry, [points[n] for n in some], [settings[n] for n in some])
            for n, result in zip(some, found, strict=True):
                results[n] = result
    return results


def shares(episodes: Sequence[int]) -> Iterator[list[int]]:
    """Yield the indices of consecutive points in groups of at most `LANES` episodes, or of one point."""
    some: list[int] = []
    for n, count in enumerate(episodes):
        if some and sum(episodes[k] for k in some) + count > LANES:
            yield some
            some = []
        some.append(n)
    if some:
        yield some


def _run_some(entry: Entry, points: Sequence[Point], each: Sequence[Settings]) -> list[dict[str, Any]]:
    """Run points that fit into one batch: together, or each episode alone where arm or policy cannot be batched."""
    task = TASKS[points[0].task]
    candidate = entry.candidate(points[0].task)
    nominal = candidate.env.unwrapped
    assert isinstance(nominal, FlexArmEnvBase)
    if entry.batched and not task.hosted:
        predict = predictor(candidate.policy, deterministic=True)
        counts = [len(point.episodes) for point in points]
        ends = np.cumsum(counts).tolist()
        of_points = [slice(end - count, end) for end, count in zip(ends, counts, strict=True)]
        env = _batch(task, [one for one, count in zip(each, counts, strict=True) for _ in range(count)])
        together = entry.independent and observation_map(env, nominal) is None
        calls = [_Call(lanes, predict, False) for lanes in ([slice(0, ends[-1])] if together else of_points)]
        made = _run(task, env, env, nominal, [one for point in points for one in point.seeded(entry.content)], calls)
        results = [{"episodes": made[lanes]} for lanes in of_points]
        # an error in a call ends all its episodes: they are run again, each alone, to see whose it is
        again = [n for n, one in enumerate(results) if any(e["ended"] == RAISED for e in one["episodes"])]
        alone = _one_by_one(entry, [points[n] for n in again], [each[n] for n in again])
        return [alone.pop(0) if n in again else one for n, one in enumerate(results)]
    return _one_by_one(entry, points, each)


def _one_by_one(entry: Entry, points: Sequence[Point], each: Sequence[Settings]) -> list[dict[str, Any]]:
    results: list[dict[str, Any]] = []
    for point, one in zip(points, each, strict=True):
        task, candidate = TASKS[point.task], entry.candidate(point.task, fresh=not entry.batched)
        nominal: Any = candidate.env.unwrapped
        calls = [_Call(slice(0, 1), predictor(candidate.policy, deterministic=True), not entry.batched)]
        made = []
        for episode in point.seeded(entry.content):
            env: Any = _hosted(entry, point) if task.hosted else _batch(task, [one])
            view = env.envs[0].unwrapped if task.hosted else env
            made += _run(task, env, view, nominal, [episode], calls)
            env.close()
        results.append({"episodes": made})
    return results


def _hosted(entry: Entry, point: Point) -> Any:
    """Make one environment whose arm is another engine's, as a vector environment."""
    options = point.environment_options(entry.interface)
    return gymnasium.make_vec(TASKS[point.task].environment, 1, vectorization_mode="sync", **options)


def _batch(task: BoardTask, each: Sequence[Settings]) -> FlexArmVectorEnv:
    values = {one.name: [getattr(settings, one.name) for settings in each] for one in fields(Settings)}
    same = {name: found[0] for name, found in values.items() if all(x == found[0] for x in found)}
    own = {name: found for name, found in values.items() if name not in same}
    steps = task.steps or round(each[0].lap_time / each[0].control_period)
    return FlexArmVectorEnv(len(each), steps, per_env=own, **same)


def _reset_options(episodes: Sequence[Episode]) -> dict[str, Any]:
    laps = [one.lap for one in episodes if one.lap is not None]
    if not laps:
        return {"start": "corner"}
    options = [LAPS[lap].reset_options() for lap in laps]
    values = {name: [one[name] for one in options] for name in options[0]}
    return {name: found if len(found) > 1 else found[0] for name, found in values.items()}


def _run(
    task: BoardTask,
    env: Any,
    view: FlexArmEnvBase,
    nominal: FlexArmEnvBase,
    episodes: Sequence[Episode],
    calls: Sequence[_Call],
) -> list[dict[str, Any]]:
    """Run one episode in each environment of a batch, and return plain values of each.

    An environment whose episode has ended begins another one, as vector environments do; that one does not count.
    """
    matrix = observation_map(view, nominal)
    observation, infos = env.reset(seed=[one.seed for one in episodes], options=_reset_options(episodes))
    steps, count = task.steps or view.lap_steps, len(episodes)
    names = (*_RECORDED[:-1], *task.recorded)
    record = {name: np.zeros((steps + 1, *np.shape(infos[name]))) for name in (*names, _RECORDED[-1])}
    drawn = _drawn(view, count)
    lengths, ended = np.full(count, steps + 1), [COMPLETE] * count
    memories: list[Any] = [None] * len(calls)
    alive, start, over = np.ones(count, bool), np.ones(count, bool), np.zeros(count, bool)
    gave_up = np.zeros(count, bool)
    success: list[bool | None] = [None] * count
    action = np.zeros(env.action_space.shape or (), dtype=np.float32)
    for k in range(steps):
        for name in names:
            record[name][k] = infos[name]
        for n, call in enumerate(calls):
            if alive[call.lanes].any():
                try:
                    action[call.lanes], memories[n] = call.choose(observation, matrix, memories[n], start)
                except (ArithmeticError, ValueError, np.linalg.LinAlgError):
                    if k == 0:  # a policy that does not work at all
                        raise
                    gave_up[call.lanes], memories[n] = alive[call.lanes], None
        lost = np.array(~np.isfinite(action).all(axis=1))
        action[lost] = 0.0
        observation, _, terminated, truncated, infos = env.step(action)
        record["torque"][k] = infos["torque"]
        for i in np.flatnonzero((terminated | truncated | lost | gave_up) & alive).tolist():
            own = RAISED if gave_up[i] else NO_ACTION if lost[i] else end_reason(infos["end_code"][i])
            ended[i] = COMPLETE if own == NOT_TERMINATED else own
            lengths[i] = k + 1 + (ended[i] in task.complete)  # with its last instant
            success[i] = bool(infos["is_success"][i]) if "is_success" in infos else None
        alive &= ~(terminated | truncated | lost | gave_up)
        start, over = over, terminated | truncated
        if not alive.any():
            break
    for name in names:
        record[name][k + 1] = infos[name]
    found = []
    for i, episode in enumerate(episodes):
        known = {name: values[: lengths[i], i] for name, values in record.items()}
        found.append(
            _outcome(task, view, episode, known, ended[i], success[i]) | ({"drawn": drawn[i]} if drawn else {})
        )
    return found


def _outcome(
    task: BoardTask, view: FlexArmEnvBase, episode: Episode, known: dict[str, Array], ended: str, success: bool | None
) -> dict[str, Any]:
    """Return plain values of an episode by its record and its end; `success` is None where the task has no goal."""
    complete = ended in task.complete
    found: dict[str, Any] = {"lap": episode.lap, "seed": episode.seed, "ended": ended}
    found |= {"duration": float(known["time"][-1]), "figures": _figures(task, view, known) if complete else None}
    return found if success is None else found | {"success": success and complete}


def _figures(task: BoardTask, view: FlexArmEnvBase, known: dict[str, Array]) -> dict[str, Any]:
    """Return the figures of a complete episode's record; what is not finite is None, which counts as lost."""
    known["torque"][-1] = known["torque"][-2]  # the last instant has none
    found = dict(task.measure(view, known))
    return found | {name: None for name in task.figures if found[name] is None or not np.isfinite(found[name])}


def _drawn(view: FlexArmEnvBase, count: int) -> list[dict[str, Any]] | None:
    """Return what each episode drew, by name, one number or two; None where nothing is drawn."""
    if not view.settings.randomisation:
        return None
    parameters = view.episode.parameters  # type: ignore[attr-defined]
    return [{name: np.asarray(values[i]).tolist() for name, values in parameters.items()} for i in range(count)]


def observation_map(env: FlexArmEnvBase, nominal: FlexArmEnvBase) -> Array | None:
    """Return the matrix from an environment's observations to those of the nominal environment; None: they are alike.

    Strain gauges keep their calibration on an arm with other shapes: the nominal arm's modal coordinates are read off
    the true deflection by the best fit in the mean square over mass, which is linear.

    Raises:
        ValueError: if observations differ in more than the modal coordinates.
    """
    if all(getattr(env.arm.parameters, name) == getattr(nominal.arm.parameters, name) for name in _SHAPES):
        return None
    own, other = env.observation_blocks, nominal.observation_blocks
    fit = block_diag(*(_link_fit(one, another) for one, another in zip(env.arm.modes, nominal.arm.modes, strict=True)))
    found = np.zeros((len(nominal.observation_scale), len(env.observation_scale)))
    for name, place in other.items():
        theirs = own[name]
        if name in _MODAL:
            block = fit
        elif name == "state":
            block = block_diag(np.eye(2), fit, np.eye(2), fit)
        elif place.stop - place.start == theirs.stop - theirs.start:
            block = np.eye(place.stop - place.start)
        else:
            raise ValueError(f"observation block {name!r}: depends on the shapes of the links")
        found[place, theirs] = block
    return np.asarray(found * env.observation_scale / nominal.observation_scale[:, None])


def _link_fit(own: LinkModes, nominal: LinkModes) -> Array:
    """Fit the nominal shapes of a link to its own ones. Shape (m nominal, m)."""
    places = 0.5 * nominal.length * (1.0 + _NODES)
    shapes = nominal.shape(places)
    weighted = shapes * _WEIGHTS[:, None]
    return np.asarray(np.linalg.solve(weighted.T @ shapes, weighted.T @ own.shape(places)), dtype=np.float64)

"""What of Gymnasium works with these environments: a row for each wrapper; see `tests.recipes.vectors` for vectors.

`python -m tests.recipes.wrappers` writes the tables of docs/recipes/wrappers.md from these rows.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from gymnasium import wrappers
from gymnasium.wrappers import vector

from scripts.common.markdown import DOCS, table
from tests.recipes import checks
from tests.recipes.checks import LIMIT, Trace, each_action, each_observation, each_reward
from tests.recipes.vectors import VECTORS
from tests.support.envs import actions_for, make
from tests.support.envs import vector as make_batch

PAGE = DOCS / "recipes" / "wrappers.md"
STEPS = 12


class Row(NamedTuple):
    """A wrapper with what is checked of it.

    Attributes:
        name: of the wrapper.
        wrap: puts it around an environment, or a batch.
        result: sentence for the page; the check holds it.
        check: gets the wrapped environment, and what the bare one gave for the actions.
        options: of the environment.
        slow: draws pictures or films.
    """

    name: str
    wrap: Callable[[Any], Any]
    result: str
    check: Callable[[Any, Trace, Any], None]
    options: dict[str, Any] = {}  # noqa: RUF012  (never changed)
    slow: bool = False


def alike(of: Any) -> dict[str, Row]:
    """Return rows of wrappers that environments and batches have by the same names, by these.

    Args:
        of: Gymnasium's module.
    """
    rows = (
        Row(
            "RescaleAction",
            lambda env: of.RescaleAction(env, np.float32(-2.0), np.float32(2.0)),
            "doubled actions are the same",
            each_action(lambda a: 2.0 * np.clip(a, -1.0, 1.0)),
        ),
        Row(
            "DtypeObservation",
            lambda env: of.DtypeObservation(env, np.float64),
            "the same numbers in float64; Gymnasium warns of an overflow when it casts the bounds",
            each_observation(lambda x: x),
        ),
        Row(
            "RescaleObservation",
            lambda env: of.RescaleObservation(env, np.float32(0.0), np.float32(1.0)),
            "from 0 to 1 between the bounds, which are wide: the environment's own `scaled` says more",
            checks.rescales,
        ),
        Row("NormalizeReward", of.NormalizeReward, "finite", checks.normalises_rewards),
        Row(
            "TransformReward",
            lambda env: of.TransformReward(env, lambda r: r - 1.0),
            "rewards are changed",
            each_reward(lambda r: r - 1.0),
        ),
        Row(
            "ClipReward",
            lambda env: of.ClipReward(env, 0.0, 0.3),
            "rewards are limited",
            each_reward(lambda r: np.clip(r, 0.0, 0.3)),
        ),
    )
    return {row.name: row for row in rows}


ONE, ALL = alike(wrappers), alike(vector)
PICTURES = {"render_mode": "rgb_array"}
SHORT = {"max_episode_steps": LIMIT}
SINGLE = (
    Row(
        "TimeLimit",
        lambda env: wrappers.TimeLimit(env, LIMIT),
        "truncates; `gymnasium.make(..., max_episode_steps=n)` is the same",
        checks.ends_by_time,
    ),
    Row(
        "RecordEpisodeStatistics",
        wrappers.RecordEpisodeStatistics,
        "return and length as summed by hand",
        checks.counts,
        SHORT,
    ),
    Row(
        "OrderEnforcing",
        lambda env: wrappers.OrderEnforcing(env.unwrapped),
        "refuses a step before the reset",
        checks.insists_on_a_reset,
    ),
    Row(
        "PassiveEnvChecker",
        lambda env: wrappers.PassiveEnvChecker(env.unwrapped),
        "has no complaint",
        each_observation(lambda x: x),
    ),
    Row(
        "Autoreset",
        wrappers.Autoreset,
        "begins the next episode in the step after the end",
        checks.resets_itself,
        SHORT,
    ),
    Row(
        "ClipAction",
        wrappers.ClipAction,
        "changes nothing: the environment limits actions itself",
        each_action(lambda a: a),
    ),
    ONE["RescaleAction"],
    Row(
        "TransformAction",
        lambda env: wrappers.TransformAction(env, np.negative, env.action_space),
        "negated actions are the same",
        each_action(np.negative),
    ),
    Row("StickyAction", lambda env: wrappers.StickyAction(env, 0.999), "an action is repeated", checks.sticks),
    Row(
        "MaxAndSkipObservation",
        lambda env: wrappers.MaxAndSkipObservation(env, 4),
        "four control periods a step; the maximum of two observations means nothing here",
        checks.repeats,
    ),
    Row(
        "RepeatAction",
        lambda env: wrappers.RepeatAction(env, 4),
        "four control periods a step, whose rewards are added",
        checks.repeats_and_adds,
    ),
    Row(
        "DiscretizeAction",
        lambda env: wrappers.DiscretizeAction(env, 5),
        "25 actions, the middle one is no torque",
        checks.discretises,
    ),
    Row(
        "TransformObservation",
        lambda env: wrappers.TransformObservation(env, lambda x: 0.5 * x, env.observation_space),
        "observations are changed",
        each_observation(lambda x: 0.5 * x),
    ),
    ONE["DtypeObservation"],
    Row(
        "ReshapeObservation",
        lambda env: wrappers.ReshapeObservation(env, (21, 2)),
        "the same numbers in another shape",
        each_observation(lambda x: x.reshape(21, 2)),
    ),
    ONE["RescaleObservation"],
    Row(
        "DiscretizeObservation",
        lambda env: wrappers.DiscretizeObservation(env, 9, multidiscrete=True),
        "nine bins a number, with `multidiscrete=True`; without it, their product is no index that a computer can hold",
        checks.bins,
    ),
    Row(
        "NormalizeObservation",
        wrappers.NormalizeObservation,
        "finite; observations are scaled already",
        checks.normalises,
    ),
    Row(
        "FrameStackObservation", lambda env: wrappers.FrameStackObservation(env, 3), "the newest is last", checks.stacks
    ),
    Row(
        "FlattenObservation",
        lambda env: wrappers.FlattenObservation(wrappers.FrameStackObservation(env, 3)),
        "of stacked frames",
        checks.flattens,
    ),
    Row(
        "DelayObservation",
        lambda env: wrappers.DelayObservation(env, 2),
        "late by whole steps, zeros until then: no late *sensor*, which `delay=` is",
        checks.delays,
    ),
    Row("TimeAwareObservation", wrappers.TimeAwareObservation, "the last number grows", checks.knows_time),
    ONE["NormalizeReward"],
    ONE["TransformReward"],
    ONE["ClipReward"],
    Row(
        "AddRenderObservation", wrappers.AddRenderObservation, "pictures as observations", checks.draws, PICTURES, True
    ),
    Row("RenderCollection", wrappers.RenderCollection, "a picture for each step", checks.collects, PICTURES, True),
    Row(
        "RecordVideo",
        lambda env: wrappers.RecordVideo(env, "films", disable_logger=True),
        "one film for the episode",
        checks.films,
        PICTURES | SHORT,
        True,
    ),
)


BATCH = (
    Row(
        "RecordEpisodeStatistics",
        vector.RecordEpisodeStatistics,
        "return and length of each environment",
        checks.counts_in_batch,
        SHORT,
    ),
    Row("ClipAction", vector.ClipAction, "changes nothing", each_action(lambda a: a)),
    ALL["RescaleAction"],
    Row(
        "TransformAction",
        lambda envs: vector.TransformAction(envs, np.negative),
        "negated actions are the same",
        each_action(np.negative),
    ),
    Row(
        "VectorizeTransformAction",
        lambda envs: vector.VectorizeTransformAction(
            envs, wrappers.TransformAction, func=np.negative, action_space=envs.single_action_space
        ),
        "the same by the wrapper of one environment",
        each_action(np.negative),
    ),
    Row(
        "TransformObservation",
        lambda env: vector.TransformObservation(env, lambda x: 0.5 * x),
        "observations are changed",
        each_observation(lambda x: 0.5 * x),
    ),
    Row(
        "VectorizeTransformObservation",
        lambda envs: vector.VectorizeTransformObservation(
            envs, wrappers.TransformObservation, func=lambda x: 0.5 * x, observation_space=envs.single_observation_space
        ),
        "the same by the wrapper of one environment",
        each_observation(lambda x: 0.5 * x),
    ),
    Row("FlattenObservation", vector.FlattenObservation, "changes nothing", each_observation(lambda x: x)),
    Row(
        "ReshapeObservation",
        lambda envs: vector.ReshapeObservation(envs, (21, 2)),
        "the same numbers in another shape",
        each_observation(lambda x: x.reshape(-1, 21, 2)),
    ),
    ALL["DtypeObservation"],
    ALL["RescaleObservation"],
    Row(
        "NormalizeObservation",
        vector.NormalizeObservation,
        "finite; with `NextStep` only",
        checks.normalises,
    ),
    ALL["NormalizeReward"],
    ALL["TransformReward"],
    Row(
        "VectorizeTransformReward",
        lambda envs: vector.VectorizeTransformReward(envs, wrappers.TransformReward, func=lambda r: r - 1.0),
        "rewards are changed",
        each_reward(lambda r: r - 1.0),
    ),
    ALL["ClipReward"],
    Row("DictInfoToList", vector.DictInfoToList, "an info for each environment", checks.lists),
    Row(
        "RecordVideo",
        lambda env: vector.RecordVideo(env, "films", video_length=LIMIT, disable_logger=True),
        "one film of all",
        checks.films,
        PICTURES | SHORT,
        True,
    ),
)


def single(options: dict[str, Any]) -> Any:
    """Make one environment."""
    return make(**options)


def batch(options: dict[str, Any]) -> Any:
    """Make a batch of three."""
    return make_batch(**options)


def actions_of(env: Any) -> Any:
    """Return actions for a trace."""
    return actions_for(env, STEPS)


def tables() -> str:
    """Write the tables of the page."""
    parts = []
    for title, rows, where in (
        ("One environment", SINGLE, "gymnasium.wrappers"),
        ("A batch", BATCH, "gymnasium.wrappers.vector"),
    ):
        lines = [[f"`{row.name}`", row.result] for row in rows]
        parts.append(f"## {title}: `{where}`\n\n{table(['wrapper', 'what is seen'], lines)}")
    vectors = [[one.name, "bitwise what the batch gives"] for one in VECTORS]
    parts.append(f"## Several environments\n\n{table(['made by', 'what is seen'], vectors)}")
    return "\n".join(parts)


HEAD = """# Gymnasium's wrappers and vectors

<!-- written by tests/recipes/wrappers.py -->

Which of Gymnasium's wrappers work with FlexArm? All below; `tests/recipes/test_wrappers.py` compares the wrapped
environment with the bare one, with the same seed and actions. Wrappers for pictures and for dict observations do not
apply, because observations are vectors; nor does `HumanRendering`, because `render_mode="human"` has its own window.
`NumpyToTorch` and its variants need `array-api-compat` and were not tried.

"""


def page() -> str:
    """Write the page."""
    return f"{HEAD}{tables()}"


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")

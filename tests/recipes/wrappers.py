"""What of Gymnasium works with these environments: a row of docs/recipes/wrappers.md for each wrapper and vector.

`python -m tests.recipes.wrappers` writes the tables of the page from these rows.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from gymnasium import wrappers as one
from gymnasium.wrappers import vector as many

from scripts.common.markdown import DOCS, table

PAGE = DOCS / "recipes" / "wrappers.md"
LIMIT = 5  # steps of a short episode
SHORT = {"max_episode_steps": LIMIT}
PICTURES = {"render_mode": "rgb_array"}


class Row(NamedTuple):
    name: str
    result: str  # what is seen of it, for the page
    wrap: Callable[[Any], Any] | None = None  # puts it around an environment, or a batch; None: it needs no arguments
    options: dict[str, Any] = {}  # noqa: RUF012  (never changed; of the environment)

    @property
    def slow(self) -> bool:
        return "render_mode" in self.options


def alike(of: Any) -> dict[str, Row]:
    """Return rows of wrappers that environments and batches have by the same names.

    Args:
        of: Gymnasium's module.
    """
    rows = (
        Row(
            "RescaleAction",
            "doubled actions are the same",
            lambda env: of.RescaleAction(env, np.float32(-2.0), np.float32(2.0)),
        ),
        Row(
            "DtypeObservation",
            "the same numbers in float64; Gymnasium warns of an overflow when it casts the bounds",
            lambda env: of.DtypeObservation(env, np.float64),
        ),
        Row(
            "RescaleObservation",
            "from 0 to 1 between the bounds, which are wide: the environment's own `scaled` says more",
            lambda env: of.RescaleObservation(env, np.float32(0.0), np.float32(1.0)),
        ),
        Row("NormalizeReward", "finite"),
        Row("TransformReward", "rewards are changed", lambda env: of.TransformReward(env, lambda r: r - 1.0)),
        Row("ClipReward", "rewards are limited", lambda env: of.ClipReward(env, 0.0, 0.3)),
        Row("NumpyToTorch", "tensors; needs `array-api-compat`"),
    )
    return {row.name: row for row in rows}


ONE, ALL = alike(one), alike(many)
SINGLE = (
    Row(
        "TimeLimit",
        "truncates; `gymnasium.make(..., max_episode_steps=n)` is the same",
        lambda env: one.TimeLimit(env, LIMIT),
    ),
    Row("RecordEpisodeStatistics", "return and length as summed by hand", options=SHORT),
    Row("OrderEnforcing", "refuses a step before the reset", lambda env: one.OrderEnforcing(env.unwrapped)),
    Row("PassiveEnvChecker", "has no complaint", lambda env: one.PassiveEnvChecker(env.unwrapped)),
    Row("Autoreset", "begins the next episode in the step after the end", options=SHORT),
    Row("ClipAction", "changes nothing: the environment limits actions itself"),
    ONE["RescaleAction"],
    Row(
        "TransformAction",
        "negated actions are the same",
        lambda env: one.TransformAction(env, np.negative, env.action_space),
    ),
    Row("StickyAction", "an action is repeated", lambda env: one.StickyAction(env, 0.999)),
    Row(
        "MaxAndSkipObservation",
        "four control periods a step; the maximum of two observations means nothing here",
        lambda env: one.MaxAndSkipObservation(env, 4),
    ),
    Row("RepeatAction", "four control periods a step, whose rewards are added", lambda env: one.RepeatAction(env, 4)),
    Row("DiscretizeAction", "25 actions, the middle one is no torque", lambda env: one.DiscretizeAction(env, 5)),
    Row(
        "TransformObservation",
        "observations are changed",
        lambda env: one.TransformObservation(env, lambda x: 0.5 * x, env.observation_space),
    ),
    ONE["DtypeObservation"],
    Row("ReshapeObservation", "the same numbers in another shape", lambda env: one.ReshapeObservation(env, (21, 2))),
    ONE["RescaleObservation"],
    Row(
        "DiscretizeObservation",
        "nine bins a number, with `multidiscrete=True`; without it, their product is no index that a computer can hold",
        lambda env: one.DiscretizeObservation(env, 9, multidiscrete=True),
    ),
    Row("NormalizeObservation", "finite; observations are scaled already"),
    Row("FrameStackObservation", "the newest is last", lambda env: one.FrameStackObservation(env, 3)),
    Row(
        "FlattenObservation", "of stacked frames", lambda env: one.FlattenObservation(one.FrameStackObservation(env, 3))
    ),
    Row(
        "DelayObservation",
        "late by whole steps, zeros until then: no late *sensor*, which `delay=` is",
        lambda env: one.DelayObservation(env, 2),
    ),
    Row("TimeAwareObservation", "the last number grows"),
    ONE["NormalizeReward"],
    ONE["TransformReward"],
    ONE["ClipReward"],
    ONE["NumpyToTorch"],
    Row("AddRenderObservation", "pictures as observations", options=PICTURES),
    Row("RenderCollection", "a picture for each step", options=PICTURES),
    Row(
        "RecordVideo",
        "one film for the episode",
        lambda env: one.RecordVideo(env, "films", disable_logger=True),
        PICTURES | SHORT,
    ),
)
BATCH = (
    Row("RecordEpisodeStatistics", "return and length of each environment", options=SHORT),
    Row("ClipAction", "changes nothing"),
    ALL["RescaleAction"],
    Row("TransformAction", "negated actions are the same", lambda envs: many.TransformAction(envs, np.negative)),
    Row(
        "VectorizeTransformAction",
        "the same by the wrapper of one environment",
        lambda envs: many.VectorizeTransformAction(
            envs, one.TransformAction, func=np.negative, action_space=envs.single_action_space
        ),
    ),
    Row(
        "TransformObservation",
        "observations are changed",
        lambda envs: many.TransformObservation(envs, lambda x: 0.5 * x),
    ),
    Row(
        "VectorizeTransformObservation",
        "the same by the wrapper of one environment",
        lambda envs: many.VectorizeTransformObservation(
            envs, one.TransformObservation, func=lambda x: 0.5 * x, observation_space=envs.single_observation_space
        ),
    ),
    Row("FlattenObservation", "changes nothing"),
    Row("ReshapeObservation", "the same numbers in another shape", lambda envs: many.ReshapeObservation(envs, (21, 2))),
    ALL["DtypeObservation"],
    ALL["RescaleObservation"],
    Row("NormalizeObservation", "finite; with `NextStep` only"),
    ALL["NormalizeReward"],
    ALL["TransformReward"],
    Row(
        "VectorizeTransformReward",
        "rewards are changed",
        lambda envs: many.VectorizeTransformReward(envs, one.TransformReward, func=lambda r: r - 1.0),
    ),
    ALL["ClipReward"],
    ALL["NumpyToTorch"]._replace(
        result="tensors; with `SameStep` it fails at an episode's end, around Gymnasium's own vectors, too"
    ),
    Row("DictInfoToList", "an info for each environment"),
    Row(
        "RecordVideo",
        "one film of all",
        lambda env: many.RecordVideo(env, "films", video_length=LIMIT, disable_logger=True),
        PICTURES | SHORT,
    ),
)
VECTORS: dict[str, dict[str, Any]] = {
    "`make_vec(id, n)` (the batch)": {},
    '`vectorization_mode="sync"`': {"vectorization_mode": "sync"},
    '`vectorization_mode="async"`, processes forked': {
        "vectorization_mode": "async",
        "vector_kwargs": {"context": "fork"},
    },
    '`vectorization_mode="async"`, processes spawned': {
        "vectorization_mode": "async",
        "vector_kwargs": {"context": "spawn"},
    },
}


def tables() -> str:
    """Write the table of the page, and the sentence of the vectors."""
    single, batch = ({row.name: row.result for row in rows} for rows in (SINGLE, BATCH))
    rows = []
    for name in {**single, **batch}:
        same = "the same" if batch.get(name) == single.get(name) else batch.get(name, "")
        rows.append([f"`{name}`", single.get(name, ""), same])
    head = ["wrapper", "of one environment (`gymnasium.wrappers`)", "of a batch (`gymnasium.wrappers.vector`)"]
    vectors = f"Several environments give the same bits, made by {'; '.join(VECTORS)}.\n"
    return f"{table(head, rows)}\n{vectors}"


HEAD = """# Gymnasium's wrappers and vectors

<!-- written by tests/recipes/wrappers.py -->

Which of Gymnasium's wrappers work with FlexArm? All below; `tests/recipes/test_wrappers.py` steps the wrapped
environment. Wrappers for pictures and for dict observations do not
apply, because observations are vectors; nor does `HumanRendering`, because `render_mode="human"` has its own window.
For batches Gymnasium has no frame stack, history or delay: `flexarm_env.wrappers.PastObservations` is all three
([batches](../how_to/batch.md#the-past)). The time of the episode is the block `time`.

"""


def page() -> str:
    return f"{HEAD}{tables()}"


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")

"""What of Gymnasium works with these environments: a row of docs/recipes/wrappers.md for each wrapper and vector.

`python -m tests.recipes.wrappers` writes the tables of the page from these rows.
"""

from collections.abc import Callable
from operator import attrgetter
from types import ModuleType
from typing import Any, NamedTuple

import numpy as np
from gymnasium.wrappers import FrameStackObservation, TransformAction, TransformObservation, TransformReward

from scripts.common.markdown import DOCS, table

PAGE = DOCS / "recipes" / "wrappers.md"
LIMIT = 5  # steps of a short episode
SHORT = {"max_episode_steps": LIMIT}
PICTURES = {"render_mode": "rgb_array"}
FILM = {"video_folder": "films", "disable_logger": True}
TWO = np.float32(2.0)
ACTIONS, OBSERVATIONS = attrgetter("action_space"), attrgetter("observation_space")


class Row(NamedTuple):
    name: str
    result: str  # what is seen of it, for the page
    arguments: tuple[Any, ...]  # of the wrapper; getters get them from what it wraps
    named: dict[str, Any]
    options: dict[str, Any]  # of the environment
    inner: Callable[[Any], Any] | None  # makes of the environment what it wraps

    @property
    def slow(self) -> bool:
        return "render_mode" in self.options

    def wrap(self, module: ModuleType, env: Any) -> Any:
        """Put the wrapper of a module around an environment, or a batch."""
        env = self.inner(env) if self.inner else env
        named = {name: got(value, env) for name, value in self.named.items()}
        return getattr(module, self.name)(env, *(got(value, env) for value in self.arguments), **named)


def got(value: Any, env: Any) -> Any:
    return value(env) if isinstance(value, attrgetter) else value


def row(name: str, result: str, *arguments: Any, options: Any = None, inner: Any = None, **named: Any) -> Row:
    return Row(name, result, arguments, named, options or {}, inner)


def half(x: Any) -> Any:
    return 0.5 * x


def less(reward: Any) -> Any:
    return reward - 1.0


CASTS = "the same numbers in float64; Gymnasium warns of an overflow when it casts the bounds"
BETWEEN = "from 0 to 1 between the bounds, which are wide: the environment's own `scaled` says more"
# Those that environments and batches have by the same names.
ALIKE = {
    "RescaleAction": row("RescaleAction", "doubled actions are the same", -TWO, TWO),
    "DtypeObservation": row("DtypeObservation", CASTS, np.float64),
    "RescaleObservation": row("RescaleObservation", BETWEEN, np.float32(0.0), np.float32(1.0)),
    "NormalizeReward": row("NormalizeReward", "finite"),
    "TransformReward": row("TransformReward", "rewards are changed", less),
    "ClipReward": row("ClipReward", "rewards are limited", 0.0, 0.3),
    "NumpyToTorch": row("NumpyToTorch", "tensors; needs `array-api-compat`"),
}
TRUNCATES = "truncates; `gymnasium.make(..., max_episode_steps=n)` is the same"
SKIPS = "four control periods a step; the maximum of two observations means nothing here"
NINE = "nine bins a number, with `multidiscrete=True`; without it, their product is no index that a computer can hold"
LATE = "late by whole steps, zeros until then: no late *sensor*, which `delay=` is"
BARE = attrgetter("unwrapped")
SINGLE = (
    row("TimeLimit", TRUNCATES, LIMIT),
    row("RecordEpisodeStatistics", "return and length as summed by hand", options=SHORT),
    row("OrderEnforcing", "refuses a step before the reset", inner=BARE),
    row("PassiveEnvChecker", "has no complaint", inner=BARE),
    row("Autoreset", "begins the next episode in the step after the end", options=SHORT),
    row("ClipAction", "changes nothing: the environment limits actions itself"),
    ALIKE["RescaleAction"],
    row("TransformAction", "negated actions are the same", np.negative, ACTIONS),
    row("StickyAction", "an action is repeated", 0.999),
    row("MaxAndSkipObservation", SKIPS, 4),
    row("RepeatAction", "four control periods a step, whose rewards are added", 4),
    row("DiscretizeAction", "25 actions, the middle one is no torque", 5),
    row("TransformObservation", "observations are changed", half, OBSERVATIONS),
    ALIKE["DtypeObservation"],
    row("ReshapeObservation", "the same numbers in another shape", (21, 2)),
    ALIKE["RescaleObservation"],
    row("DiscretizeObservation", NINE, 9, multidiscrete=True),
    row("NormalizeObservation", "finite; observations are scaled already"),
    row("FrameStackObservation", "the newest is last", 3),
    row("FlattenObservation", "of stacked frames", inner=lambda env: FrameStackObservation(env, 3)),
    row("DelayObservation", LATE, 2),
    row("TimeAwareObservation", "the last number grows"),
    *(ALIKE[name] for name in ("NormalizeReward", "TransformReward", "ClipReward", "NumpyToTorch")),
    row("AddRenderObservation", "pictures as observations", options=PICTURES),
    row("RenderCollection", "a picture for each step", options=PICTURES),
    row("RecordVideo", "one film for the episode", options=PICTURES | SHORT, **FILM),
)
OF_ONE = "the same by the wrapper of one environment"
ITS_ACTIONS, ITS_OBSERVATIONS = attrgetter("single_action_space"), attrgetter("single_observation_space")
ENDS = "tensors; with `SameStep` it fails at an episode's end, around Gymnasium's own vectors, too"
BATCH = (
    row("RecordEpisodeStatistics", "return and length of each environment", options=SHORT),
    row("ClipAction", "changes nothing"),
    ALIKE["RescaleAction"],
    row("TransformAction", "negated actions are the same", np.negative),
    row("VectorizeTransformAction", OF_ONE, TransformAction, func=np.negative, action_space=ITS_ACTIONS),
    row("TransformObservation", "observations are changed", half),
    row("VectorizeTransformObservation", OF_ONE, TransformObservation, func=half, observation_space=ITS_OBSERVATIONS),
    row("FlattenObservation", "changes nothing"),
    row("ReshapeObservation", "the same numbers in another shape", (21, 2)),
    ALIKE["DtypeObservation"],
    ALIKE["RescaleObservation"],
    row("NormalizeObservation", "finite; with `NextStep` only"),
    ALIKE["NormalizeReward"],
    ALIKE["TransformReward"],
    row("VectorizeTransformReward", "rewards are changed", TransformReward, func=less),
    ALIKE["ClipReward"],
    ALIKE["NumpyToTorch"]._replace(result=ENDS),
    row("DictInfoToList", "an info for each environment"),
    row("RecordVideo", "one film of all", options=PICTURES | SHORT, video_length=LIMIT, **FILM),
)
VECTORS: dict[str, dict[str, Any]] = {
    "`make_vec(id, n)` (the batch)": {},
    '`vectorization_mode="sync"`': {"vectorization_mode": "sync"},
    **{
        f'`vectorization_mode="async"`, processes {context}ed': {
            "vectorization_mode": "async",
            "vector_kwargs": {"context": context},
        }
        for context in ("fork", "spawn")
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

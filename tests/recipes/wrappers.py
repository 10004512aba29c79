"""What of Gymnasium works with these environments: a row for each wrapper and vector."""

from collections.abc import Callable
from operator import attrgetter
from types import ModuleType
from typing import Any, NamedTuple

import numpy as np
from gymnasium.wrappers import FrameStackObservation, TransformAction, TransformObservation, TransformReward

LIMIT = 5  # steps of a short episode
SHORT = {"max_episode_steps": LIMIT}
PICTURES = {"render_mode": "rgb_array"}
FILM = {"video_folder": "films", "disable_logger": True}
TWO = np.float32(2.0)
ACTIONS, OBSERVATIONS = attrgetter("action_space"), attrgetter("observation_space")


class Row(NamedTuple):
    name: str
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


def row(name: str, *arguments: Any, options: Any = None, inner: Any = None, **named: Any) -> Row:
    return Row(name, arguments, named, options or {}, inner)


def half(x: Any) -> Any:
    return 0.5 * x


def less(reward: Any) -> Any:
    return reward - 1.0


# Those that environments and batches have by the same names.
ALIKE = {
    "RescaleAction": row("RescaleAction", -TWO, TWO),
    "DtypeObservation": row("DtypeObservation", np.float64),
    "RescaleObservation": row("RescaleObservation", np.float32(0.0), np.float32(1.0)),
    "NormalizeReward": row("NormalizeReward"),
    "TransformReward": row("TransformReward", less),
    "ClipReward": row("ClipReward", 0.0, 0.3),
    "NumpyToTorch": row("NumpyToTorch"),
}
BARE = attrgetter("unwrapped")
SINGLE = (
    row("TimeLimit", LIMIT),
    row("RecordEpisodeStatistics", options=SHORT),
    row("OrderEnforcing", inner=BARE),
    row("PassiveEnvChecker", inner=BARE),
    row("Autoreset", options=SHORT),
    row("ClipAction"),
    ALIKE["RescaleAction"],
    row("TransformAction", np.negative, ACTIONS),
    row("StickyAction", 0.999),
    row("MaxAndSkipObservation", 4),
    row("RepeatAction", 4),
    row("DiscretizeAction", 5),
    row("TransformObservation", half, OBSERVATIONS),
    ALIKE["DtypeObservation"],
    row("ReshapeObservation", (21, 2)),
    ALIKE["RescaleObservation"],
    row("DiscretizeObservation", 9, multidiscrete=True),
    row("NormalizeObservation"),
    row("FrameStackObservation", 3),
    row("FlattenObservation", inner=lambda env: FrameStackObservation(env, 3)),
    row("DelayObservation", 2),
    row("TimeAwareObservation"),
    *(ALIKE[name] for name in ("NormalizeReward", "TransformReward", "ClipReward", "NumpyToTorch")),
    row("AddRenderObservation", options=PICTURES),
    row("RenderCollection", options=PICTURES),
    row("RecordVideo", options=PICTURES | SHORT, **FILM),
)
ITS_ACTIONS, ITS_OBSERVATIONS = attrgetter("single_action_space"), attrgetter("single_observation_space")
BATCH = (
    row("RecordEpisodeStatistics", options=SHORT),
    row("ClipAction"),
    ALIKE["RescaleAction"],
    row("TransformAction", np.negative),
    row("VectorizeTransformAction", TransformAction, func=np.negative, action_space=ITS_ACTIONS),
    row("TransformObservation", half),
    row("VectorizeTransformObservation", TransformObservation, func=half, observation_space=ITS_OBSERVATIONS),
    row("FlattenObservation"),
    row("ReshapeObservation", (21, 2)),
    ALIKE["DtypeObservation"],
    ALIKE["RescaleObservation"],
    row("NormalizeObservation"),
    ALIKE["NormalizeReward"],
    ALIKE["TransformReward"],
    row("VectorizeTransformReward", TransformReward, func=less),
    ALIKE["ClipReward"],
    ALIKE["NumpyToTorch"],
    row("DictInfoToList"),
    row("RecordVideo", options=PICTURES | SHORT, video_length=LIMIT, **FILM),
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

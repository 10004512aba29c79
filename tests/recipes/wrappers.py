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
    wrap: Callable[[ModuleType, Any], Any]  # puts the wrapper of a module around an environment, or a batch
    options: dict[str, Any]  # of the environment


def row(name: str, *arguments: Any, options: Any = None, inner: Any = None, **named: Any) -> Row:
    """Return a wrapper's row; getters get arguments from what it wraps, which `inner` makes of the environment."""

    def wrap(module: ModuleType, env: Any) -> Any:
        env = inner(env) if inner else env
        got = [value(env) if isinstance(value, attrgetter) else value for value in (*arguments, *named.values())]
        own, by_name = got[: len(arguments)], dict(zip(named, got[len(arguments) :], strict=True))
        return getattr(module, name)(env, *own, **by_name)

    return Row(name, wrap, options or {})


def half(x: Any) -> Any:
    return 0.5 * x


def less(reward: Any) -> Any:
    return reward - 1.0


# Those that environments and batches have by the same names.
ALIKE = (
    row("ClipAction"),
    row("RescaleAction", -TWO, TWO),
    row("DtypeObservation", np.float64),
    row("ReshapeObservation", (21, 2)),
    row("RescaleObservation", np.float32(0.0), np.float32(1.0)),
    row("NormalizeObservation"),
    row("NormalizeReward"),
    row("TransformReward", less),
    row("ClipReward", 0.0, 0.3),
    row("NumpyToTorch"),
    row("RecordEpisodeStatistics", options=SHORT),
    row("RecordVideo", options=PICTURES | SHORT, video_length=LIMIT, **FILM),
)
BARE = attrgetter("unwrapped")
SINGLE = (
    *ALIKE,
    row("TimeLimit", LIMIT),
    row("OrderEnforcing", inner=BARE),
    row("PassiveEnvChecker", inner=BARE),
    row("Autoreset", options=SHORT),
    row("TransformAction", np.negative, ACTIONS),
    row("TransformObservation", half, OBSERVATIONS),
    row("StickyAction", 0.999),
    row("MaxAndSkipObservation", 4),
    row("RepeatAction", 4),
    row("DiscretizeAction", 5),
    row("DiscretizeObservation", 9, multidiscrete=True),
    row("FrameStackObservation", 3),
    row("FlattenObservation", inner=lambda env: FrameStackObservation(env, 3)),
    row("DelayObservation", 2),
    row("TimeAwareObservation"),
    row("AddRenderObservation", options=PICTURES),
    row("RenderCollection", options=PICTURES),
)
ITS_ACTIONS, ITS_OBSERVATIONS = attrgetter("single_action_space"), attrgetter("single_observation_space")
BATCH = (
    *ALIKE,
    row("TransformAction", np.negative),
    row("TransformObservation", half),
    row("VectorizeTransformAction", TransformAction, func=np.negative, action_space=ITS_ACTIONS),
    row("VectorizeTransformObservation", TransformObservation, func=half, observation_space=ITS_OBSERVATIONS),
    row("FlattenObservation"),
    row("VectorizeTransformReward", TransformReward, func=less),
    row("DictInfoToList"),
)
VECTORS: dict[str, dict[str, Any]] = {
    "batch": {},
    "sync": {"vectorization_mode": "sync"},
    "async, fork": {"vectorization_mode": "async", "vector_kwargs": {"context": "fork"}},
    "async, spawn": {"vectorization_mode": "async", "vector_kwargs": {"context": "spawn"}},
}

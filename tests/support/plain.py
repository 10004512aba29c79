"""Kernels in plain Python: slow to step, but nothing is compiled, and the same but for rounding.

To compile kernels takes as long as some hundred periods in plain Python. Tests step a few kernels often: these are
compiled (`is_shared`). All others of environments run in plain Python, unless a test is marked `compiled` or `slow`.
`run_plainly` exchanges kernels below whatever uses them; `PlainEnvironment` is a batch of one without Gymnasium.
"""

from collections.abc import Callable, Iterable
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray

from flexarm_env.codegen import cache, compiler
from flexarm_env.codegen.declarations import AnyVariant, plain_python
from flexarm_env.envs.batch import BatchSimulator
from flexarm_env.envs.settings import Settings
from flexarm_env.episode.step import GAIN, HOST_PROGRAMS, PROGRAMS, TORQUE, TRACKING, step_only
from flexarm_env.kernels.entries import word
from flexarm_env.kernels.variants import Variant


def is_shared(variant: AnyVariant) -> bool:
    """Whether many tests step these kernels: the square's for both arms, and those of the paper's environment."""
    return variant in _SHARED


def run_plainly(
    monkeypatch: pytest.MonkeyPatch, compiled: Callable[[AnyVariant], bool] = lambda variant: False
) -> None:
    """Let environments step in plain Python unless `compiled`; what else uses kernels compiles them as ever."""
    load, compiled_entry = compiler.load, cache.compiled_entry

    def load_plain(variant: AnyVariant) -> Any:
        if variant.program not in _EPISODES or compiled(variant):
            return load(variant)
        entries = variant.program.entries(variant.lanes)
        return SimpleNamespace(**{entry.__name__: _PlainEntry(entry, variant) for entry in entries})

    def plain_entry(kernel: Any, *arguments: Any) -> Any:
        return kernel if isinstance(kernel, _PlainEntry) else compiled_entry(kernel, *arguments)

    monkeypatch.setattr(compiler, "load", load_plain)
    monkeypatch.setattr(cache, "compiled_entry", plain_entry)


def compile_what_is_shared(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let environments step in plain Python unless their kernels are shared."""
    run_plainly(monkeypatch, is_shared)


class _PlainEntry(NamedTuple):
    entry: Callable[..., Any]
    variant: AnyVariant

    def __call__(self, *arguments: Any) -> Any:
        with plain_python(self.variant), np.errstate(all="ignore"):  # keys overflow, and states diverge, as compiled
            return self.entry(*arguments)


_EPISODES = (*PROGRAMS.values(), *HOST_PROGRAMS.values())
_LINEAR_ARM: dict[str, Any] = {"sensor": "true", "law_on_sensor": False}
_DEFAULT_ARM = _LINEAR_ARM | {"foreshortened": True}
_SHARED = {
    variant
    for lanes in (1, 8)
    for variant in (
        Variant(TORQUE, 2, True, lanes, **_LINEAR_ARM),
        Variant(TORQUE, 3, True, lanes, **_DEFAULT_ARM),
        Variant(TORQUE, 3, True, lanes, **_DEFAULT_ARM, disturbed=True),
        Variant(TRACKING, 2, True, lanes, **_LINEAR_ARM),
        Variant(GAIN, 1, False, lanes),
        Variant(GAIN, 3, True, lanes, **_DEFAULT_ARM),
    )
}
# Of a test whose kernels no other test compiles, but for a few: those run in plain Python, or in a slow test compiled.
KERNELS = ("plain", pytest.param("compiled", marks=pytest.mark.slow))


class PlainEnvironment:
    """One environment; `simulator` is the batch of one that it steps."""

    def __init__(self, key: int = 0, **options: Any) -> None:
        """Lay out its memory and begin an episode; `options`: as of `FlexArm/Square-v0`."""
        self.simulator = BatchSimulator(Settings.of(options), 1)
        self.reset(key)

    def reset(self, key: int = 0) -> None:
        """Begin an episode; `key`: of its random numbers."""
        self.simulator.request_resets(np.array([key], dtype=np.uint64), np.array([0]), self.simulator.usual_requests)
        self.simulator._header[word.DRIVING] = 0
        self._run()
        self.simulator._header[word.DRIVING] = 1

    def step(self, action: ArrayLike) -> None:
        """Hold an action for a control period. Shape (channels,)."""
        self.simulator.actions[0] = action
        self._run()

    def follow(self, actions: Iterable[ArrayLike], *names: str) -> list[NDArray[Any]]:
        """Hold each action for a period; return what is known at each instant, the present one first.

        Args:
            actions: shape (periods, channels).
            names: of results, in capitals, and of blocks.

        Returns:
            For each name an array of shape (periods + 1, k).
        """
        of = [self.result if name.isupper() else self.block for name in names]
        rows = [[each(name) for each, name in zip(of, names, strict=True)]]
        for action in actions:
            self.step(action)
            rows.append([each(name) for each, name in zip(of, names, strict=True)])
        return [np.array(column) for column in zip(*rows, strict=True)]

    def block(self, name: str) -> NDArray[np.float32]:
        """Return a block of the present observation, in a new array."""
        return self.simulator.observations[0, self.simulator.layout.blocks[name]].copy()

    def result(self, name: str) -> NDArray[np.float64]:
        """Return a part of what is known at the present instant (`result_sizes`), in a new array."""
        return self.simulator.result(0)[self.simulator.parts[name]]

    def row(self, name: str) -> NDArray[np.float64]:
        """Return a row of the arena, in a new array. Shape (count,)."""
        first, count = self.simulator._rows[name]
        return self.simulator._arenas[0, first : first + count, 0].copy()

    def _run(self) -> None:
        with plain_python(self.simulator._variant), np.errstate(all="ignore"):  # keys overflow, as compiled
            assert step_only(self.simulator._memory), "an action that is not finite"

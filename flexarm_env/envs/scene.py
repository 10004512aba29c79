"""`Scene`: makes the renderer's snapshots of one arm of a batch."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexarm_env.actions import TORQUE_LIMIT
from flexarm_env.envs.batch import BatchSimulator
from flexarm_env.envs.rendering import Renderer, Snapshot

Array = NDArray[np.float64]
LONGEST_TRACE = 4096
MARGIN = 1.05  # of the reach, so that a bent arm fits


class Scene:
    """Draws one arm of a batch, with the trace of its tip."""

    def __init__(self, simulator: BatchSimulator, index: int, render_mode: str, fps: int) -> None:
        """Prepare the renderer; it imports and opens nothing before the first picture."""
        self._simulator, self._index = simulator, index
        self._renderer = Renderer(render_mode, fps=fps)
        self._trace: list[Array] = []
        self._stride, self._skipped = 1, 0

    def begin(self, result: Array) -> None:
        """Begin the trace of a new episode with its first result."""
        self._trace.clear()
        self._stride, self._skipped = 1, 0
        self.add(result)

    def add(self, result: Array) -> None:
        """Add an instant to the trace; a long trace is thinned evenly."""
        self._skipped += 1
        if self._skipped < self._stride and self._trace:
            return
        self._skipped = 0
        self._trace.append(result[self._simulator.parts["TRUE_TIP"]].copy())
        if len(self._trace) > LONGEST_TRACE:
            del self._trace[1::2]
            self._stride *= 2

    def draw(self, result: Array) -> NDArray[np.uint8] | None:
        """Draw an instant; return a picture in "rgb_array", None in "human"."""
        return self._renderer.draw(self._snapshot(result))

    def close(self) -> None:
        """Close the window, if there is one."""
        self._renderer.close()

    def _snapshot(self, result: Array) -> Snapshot:
        settings = self._simulator.each[self._index]
        values: dict[str, Any] = {name: result[part] for name, part in self._simulator.parts.items()}
        drawing = self._simulator.drawing(self._index, result)
        gain = settings.mode.law == "tip"
        return Snapshot(
            time=float(values["TIME"][0]),
            links=drawing.links,
            path=self._simulator.path(self._index),
            trace=np.array([*self._trace, values["TRUE_TIP"]]),
            reference=values["REFERENCE"][:2],
            sensor=drawing.sensor,
            sensed=values["LINK_SENSOR"],
            torque=values["TORQUE"],
            torque_scale=TORQUE_LIMIT if np.inf in settings.motor_limit else settings.motor_limit,
            gain=float(values["EFFECTIVE_GAIN"][0]) if gain else None,
            gain_limit=settings.gain_limit,
            carries=bool(np.any(values.get("CARRIED", 0.0))),
            reach=MARGIN * settings.flexible_arm.parameters.reach,
        )

"""The base of controllers that command torques: it turns observations into readings, and torques into actions.

A controller names the blocks that it reads, and returns torques; this one brakes the joints:

    >>> import gymnasium
    >>> class Brake(TorqueController):
    ...     blocks = ("joint_rates",)
    ...
    ...     def torque(self, seen, memory):
    ...         return -20.0 * seen["joint_rates"], memory  # [N m]
    >>> env = gymnasium.make("flexarm_env:FlexArm/Square-v0", **Brake.options())
    >>> observation, info = env.reset(seed=0)
    >>> action, memory = Brake.for_env(env).predict(observation)
    >>> action.shape
    (2,)
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any, ClassVar, Self

import numpy as np

from flexarm_baselines.arrays import Array, Float32s, Floats
from flexarm_baselines.policy import Observation, State, checked_observation
from flexarm_baselines.task import Task

Memory = tuple[Floats, ...]


class Seen:
    """What n arms observe at one instant, in SI units; blocks by name.

    Attributes:
        task: the task that they share.
        observations: as the environment gave them. Shape (n, k).
    """

    def __init__(self, task: Task, observations: Array) -> None:
        """Keep both; blocks are converted when they are read."""
        self.task, self.observations = task, observations

    def __len__(self) -> int:
        """Return the number of arms."""
        return len(self.observations)

    def __getitem__(self, block: str) -> Floats:
        """Return a block in its unit. Shape (n, numbers)."""
        return self.task.read(self.observations, block)

    @property
    def time(self) -> Floats:
        """Moment of the lap [s]; needs the block `lap_phase`. Shape (n,)."""
        return self.task.time_of(self.observations)

    @property
    def period(self) -> Array:
        """Number of the lap's control period that begins, by the block `lap_phase`; 0 where it is NaN. Shape (n,)."""
        return np.round(np.nan_to_num(self.time / self.task.period)).astype(np.int64)

    def of(self, arms: Array) -> Seen:
        """Return what some of the arms observe."""
        return Seen(self.task, self.observations[arms])


class TorqueController(ABC):
    """A controller whose action is the motors' torques, with stable-baselines3's `predict`.

    A subclass names the blocks that it reads, begins a memory for arms whose episode starts, and computes torques. It
    runs on one arm or a batch; what it remembers of n arms is a tuple of arrays with a leading axis of n, and goes
    through `state`, so that one controller serves any number of runs at once.

    Attributes:
        blocks: names of the observation's blocks that it reads, in order.
        knows: its inputs beside the observation, as `flexarm_env.envs.blocks.INFORMATION` calls it.
        task: see `Task`.
    """

    blocks: ClassVar[tuple[str, ...]]
    knows: ClassVar[tuple[str, ...]] = ("preview", "plant parameters")

    def __init__(self, task: Task) -> None:
        """Keep the task.

        Raises:
            ValueError: if its observation lacks a block.
        """
        self.task = task
        for block in self.blocks:
            if block not in task.blocks:
                raise ValueError(
                    f"env: {type(self).__name__} reads the block {block!r}; make the environment with "
                    f"**{type(self).__name__}.options()"
                )

    def __repr__(self) -> str:
        """Name the controller and what it reads, in a line."""
        return f"{type(self).__name__}(blocks={self.blocks})"

    @classmethod
    def options(cls) -> dict[str, Any]:
        """Return the options with which an environment gives the controller what it reads."""
        options = {"action_mode": "torque", "observation": cls.blocks, "frame": "world", "scaled": False}
        return options | {"last_actions": 1}  # some ids have another number, which nothing would use

    @classmethod
    def for_env(cls, env: Any, **design: Any) -> Self:
        """Make the controller for an environment, single or vector, that was made with `options()`.

        Args:
            env: a FlexArm environment.
            **design: what the controller's constructor takes beside the task.

        Raises:
            ValueError: if it does not give what the controller reads.
        """
        return cls(Task.of(env), **design)

    def start(self, seen: Seen) -> Memory:
        """Return the memory of arms whose episode begins: nothing, unless a subclass remembers something.

        Args:
            seen: their first observations.
        """
        return ()

    @abstractmethod
    def torque(self, seen: Seen, memory: Memory) -> tuple[Floats, Memory]:
        """Return the torques for the next control period, and the memory for the instant after it.

        `action` clips them to the motors' limits; a controller that needs the torques which act must clip them itself.

        Args:
            seen: the observations.
            memory: memory of the same arms.

        Returns:
            Torques of shoulder and elbow [N m], Shape (n, 2), and the memory.
        """

    def predict(
        self,
        observation: Observation,
        state: State = None,
        episode_start: Array | None = None,
        deterministic: bool = True,
    ) -> tuple[Float32s, State]:
        """Choose actions; see `Policy.predict`. Without a state, every arm's episode begins."""
        rows = checked_observation(observation, len(self.task.scale))
        seen = Seen(self.task, np.atleast_2d(rows))
        torque, memory = self.torque(seen, self._memory(seen, state, episode_start))
        action = self.action(seen, torque).astype(np.float32)
        return action.reshape(*rows.shape[:-1], action.shape[1]), memory

    def action(self, seen: Seen, torque: Floats) -> Floats:
        """Return the actions that command some torques. Shape (n, channels).

        Args:
            seen: the observations.
            torque: [N m]. Shape (n, 2).
        """
        return np.clip(torque / np.asarray(self.task.torque_limit), -1.0, 1.0)

    def _memory(self, seen: Seen, state: State, episode_start: Array | None) -> Memory:
        """Begin the memory of the arms whose episode starts, and keep that of the others."""
        if state is None:
            return self.start(seen)
        begins = False if episode_start is None else episode_start
        starting = np.broadcast_to(np.asarray(begins, dtype=bool), len(seen))
        if not starting.any():
            return state
        memory = tuple(part.copy() for part in state)
        for part, begun in zip(memory, self.start(seen.of(starting)), strict=True):
            part[starting] = begun
        return memory

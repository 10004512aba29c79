"""What single and vector environments have in common: properties, options that last, rewards and ends of the user's."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import gymnasium
import numpy as np
from gymnasium.envs.registration import EnvSpec
from numpy.typing import ArrayLike, NDArray

from flexarm_env.envs.batch import OWN_END, BatchSimulator
from flexarm_env.envs.info import InfoMaker
from flexarm_env.envs.reset_options import reset_requests_of
from flexarm_env.envs.scene import Scene
from flexarm_env.envs.settings import Settings
from flexarm_env.simulation.arm import FlexibleArm
from flexarm_env.validation import mapping, real_array, shown

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
FASTEST_VIDEO = 100  # [1/s]; a picture is drawn for each step, and slower control plays in real time
A_RACE = 60.0  # [s]; long enough for three laps of the square
NOBODY = np.zeros(0, dtype=np.int64)
NOBODY.setflags(write=False)


class FlexArmEnvBase:
    """Properties that single and vector environments have in common."""

    simulator: BatchSimulator
    spec: EnvSpec | None
    render_mode: str | None
    metadata: dict[str, Any]
    _started: bool
    _infos: InfoMaker
    _scenes: list[Scene]  # one for each environment where pictures are drawn
    _lasting: Array | None = None  # requests for resets that `set_options` has left

    def __repr__(self) -> str:
        """Describe the environment in a line."""
        return self._described()

    def __str__(self) -> str:
        """Return the same: Gymnasium's wrappers write it within their own."""
        return repr(self)

    def _described(self, *more: str) -> str:
        settings = self.settings
        name = " ".join([type(self).__name__, *([self.spec.id] if self.spec else [])])
        period, size = f"{1e3 * settings.control_period:g} ms", len(self.simulator.layout.scale)
        facts = (*more, settings.action_mode, f"arm={shown(settings.arm)}", period, f"{size} numbers observed")
        return f"<{name}: {', '.join(facts)}>"

    def _check_begun(self) -> None:
        if not self._started:
            raise AttributeError("episode: none has begun; call reset() first")

    def _begun_drawing(self) -> bool:
        """Return whether there is a render mode, and warn if not; before a reset there is nothing to draw."""
        if self.render_mode is None:
            gymnasium.logger.warn('render() without a render mode; give make one, e.g. render_mode="rgb_array"')
        elif not self._started:
            raise RuntimeError("render() before reset(): there is nothing to show")
        return self.render_mode is not None

    def _lay_out(self, simulator: BatchSimulator, render_mode: str | None) -> tuple[Any, Any]:
        """Keep the simulator and what reads it; return the spaces of one environment's observations and actions."""
        self.simulator, self.render_mode, self._started = simulator, render_mode, False
        self._infos, self._judges = InfoMaker(simulator), self.settings.has_own_terms
        # a picture for each control period, at most `FASTEST_VIDEO` a second
        fps = min(FASTEST_VIDEO, max(1, round(1.0 / self.control_period)))
        self.metadata = self.metadata | {"render_fps": fps}
        self._scenes = [Scene(simulator, i, render_mode, fps) for i in range(len(simulator))] if render_mode else []
        bound = self.simulator.layout.bound
        observation = gymnasium.spaces.Box(-bound, bound, dtype=np.float32)
        return observation, gymnasium.spaces.Box(-1.0, 1.0, (len(self.settings.action_limit),), np.float32)

    def _remember(self, begun: Indices = NOBODY, moved: bool = True) -> None:
        """Add the present instant to the pictures of environments that have begun an episode, or moved; show it."""
        for i, scene in enumerate(self._scenes):
            if moved or i in begun:
                result = self.simulator.result(i)
                (scene.begin if i in begun else scene.add)(result)
                if self.render_mode == "human":
                    scene.draw(result)

    @property
    def settings(self) -> Settings:
        """All options, validated; those of environment 0 if the environments of a batch have different ones."""
        return self.simulator.settings

    @property
    def arm(self) -> FlexibleArm:
        """The arm, unless an episode draws another payload, stiffness or damping."""
        return self.settings.flexible_arm

    @property
    def observation_blocks(self) -> dict[str, slice]:
        """Where each named block lies in an observation."""
        return dict(self.simulator.layout.blocks)

    @property
    def observation_scale(self) -> NDArray[np.float64]:
        """Divisor of each number of an observation, in the block's unit. Shape (k,)."""
        return self.simulator.layout.scale.copy()

    @property
    def observation_mirror(self) -> NDArray[np.float32]:
        """Sign of each number of an observation in the mirrored episode. Shape (k,)."""
        return self.simulator.layout.mirror.copy()

    @property
    def action_mirror(self) -> NDArray[np.float32]:
        """Sign of each number of an action in the mirrored episode. Shape (channels,)."""
        return np.resize(np.array(self.settings.mode.mirror, dtype=np.float32), len(self.settings.action_limit))

    def mirror_observation(self, observation: ArrayLike) -> NDArray[np.float32]:
        """Return what the mirrored arm observes; mirroring twice gives the observation back.

        Args:
            observation: one, or any number of them. Shape (..., k).
        """
        return _mirrored("observation", observation, self.observation_mirror)

    def mirror_action(self, action: ArrayLike) -> NDArray[np.float32]:
        """Return the action that does to the mirrored arm what this one does to the arm.

        Args:
            action: one, or any number of them. Shape (..., channels).
        """
        return _mirrored("action", action, self.action_mirror)

    @property
    def gain_limit(self) -> float:
        """Gain lambda at action 1.

        Raises:
            AttributeError: the action is not the gain.
        """
        if self.settings.mode.limit != "gain_limit":
            raise AttributeError(f"gain_limit: the action is {self.settings.action_mode!r}, not the gain")
        return self.settings.gain_limit

    @property
    def control_period(self) -> float:
        """Time for which an action is held [s]."""
        return self.settings.control_period

    @property
    def lap_steps(self) -> int:
        """Control periods in a lap; in the longest, where episodes draw it; of a race, in a minute."""
        longest = A_RACE if self.settings.mode.races else self.settings.laps[1]
        return max(1, round(longest / self.settings.control_period))

    # --- what later steps and episodes take --------------------------------------------------------------------------

    def set_reference(
        self,
        position: ArrayLike,
        velocity: ArrayLike = (0.0, 0.0),
        previews: ArrayLike | None = None,
        rows: Sequence[int] | Indices | None = None,
    ) -> None:
        """Move the target, from the present instant on; the next step observes it. Only with `reference="target"`.

        It goes on with its velocity, and stops where the reach ends, until it is set again or the episode ends. A late
        reading is compared with where the target was then.

        Args:
            position: x, y [m]. Shape (2,), or (n, 2) with one for each environment.
            velocity: [m/s]. Shape (2,) or (n, 2).
            previews: where it will be at each horizon of the option `previews`, straight in between [m]; None: by the
                velocity. Shape (horizons, 2) or (n, horizons, 2).
            rows: indices of the environments; None: all.

        Raises:
            TypeError, ValueError: for another reference, what is out of reach or too fast, or another shape.
            RuntimeError: before the first reset.
        """
        self.simulator.set_target(self._chosen("set_reference", rows), position, velocity, previews)

    def set_options(self, options: Mapping[str, Any]) -> None:
        """Set how all later episodes begin, also after an autoreset; the options of a `reset` override it.

        Args:
            options: keys of `flexarm_env.envs.reset_options.OPTIONS` with a value for all environments or one for each,
                in place of those of an earlier call; and `randomisation`, distributions within those of `make`, where
                what is left out stays as it is. Alone, it leaves the other options as they are.

        Raises:
            TypeError, ValueError: for an unknown option or a bad value; nothing has changed then.
        """
        asked = mapping("options", options)
        alone = asked.keys() == {"randomisation"}
        ranges = asked.pop("randomisation", {})
        requests = reset_requests_of(asked, self.simulator)
        self.simulator.draws.narrow(ranges)
        if not alone:
            self._lasting = requests if asked else None

    def _requests(self, options: Mapping[str, Any] | None = None) -> Array:
        return reset_requests_of(options, self.simulator, self._lasting)

    def _judge(self, results: Array, begun: Indices = NOBODY) -> None:
        """Write the rewards and terminations by the user's functions into the results of a step.

        Args:
            results: of the step; changed. Shape (N, k).
            begun: environments that began an episode in this step; they have no reward and do not end. Shape (n,).

        Raises:
            TypeError, ValueError: for what a function returns of another shape or type, or a reward that is not finite.
        """
        settings, seen = self.settings, results.view()
        seen.flags.writeable = False  # infos show the same memory
        known = self._infos.quantities(seen)
        rewards, status = (results[:, self.simulator.parts[name].start] for name in ("REWARD", "STATUS"))
        if settings.reward is not None:
            found = _checked("reward", settings.reward(known), len(results), "fiu", "real numbers")
            rewards[:] = np.where((status == 0.0) | (status < -1.5), found, 0.0)  # an invalid state has no reward
            rewards[begun] = 0.0
            if not np.isfinite(rewards).all():
                raise ValueError(f"reward(infos)[{int(np.argmin(np.isfinite(rewards)))}]: must be finite")
        if settings.termination is not None:
            ends = _checked("termination", settings.termination(known), len(results), "b", "bool") & (status == 0.0)
            ends[begun] = False
            status[ends] = OWN_END
            self.simulator.end(ends.nonzero()[0])

    def _chosen(self, caller: str, rows: Sequence[int] | Indices | None) -> Indices:
        count = len(self.simulator)
        if not self._started:
            raise RuntimeError(f"{caller}() before reset(): there are no states")
        if rows is None:
            return np.arange(count)
        chosen = np.asarray(rows)
        if chosen.ndim != 1 or chosen.dtype.kind not in "iu" or not len(chosen):
            raise ValueError(f"rows = {shown(rows)}: must be indices of environments")
        if chosen.min() < 0 or chosen.max() >= count or len(np.unique(chosen)) < len(chosen):
            raise ValueError(f"rows = {shown(rows)}: must be from 0 to {count - 1}, each only once")
        return chosen.astype(np.int64)


def _mirrored(name: str, values: ArrayLike, signs: NDArray[np.float32]) -> NDArray[np.float32]:
    numbers = real_array(name, values).astype(np.float32)
    if numbers.shape[-1:] != signs.shape:
        raise ValueError(f"{name}: must have shape (..., {len(signs)}), got {numbers.shape}")
    return numbers * signs


def _checked(name: str, found: Any, count: int, kinds: str, what: str) -> NDArray[Any]:
    array = np.asarray(found)
    if array.shape != (count,) or array.dtype.kind not in kinds:
        raise TypeError(f"{name}(infos) = {shown(found)}: must be an array of {what}, of shape ({count},)")
    return array


def rounded(actions: NDArray[Any]) -> NDArray[np.float32]:
    """Convert actions to the action space's float32, limited first: a float64 may exceed the range of float32."""
    limited = np.minimum(np.maximum(actions.astype(np.float64), -1.0), 1.0)  # faster than `np.clip`
    return limited.astype(np.float32)

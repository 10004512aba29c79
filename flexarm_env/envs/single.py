"""`FlexArmEnv`: one arm as a Gymnasium environment.

A step from the first corner, where the reference leaves at full speed:

    >>> import gymnasium
    >>> import flexarm_env
    >>> env = gymnasium.make("FlexArm/Square-v0")
    >>> observation, info = env.reset(seed=0, options={"start": "corner"})
    >>> observation.shape, env.unwrapped.observation_blocks["sensor_error"]
    ((46,), slice(14, 16, None))
    >>> observation, reward, terminated, truncated, info = env.step([1.0, -0.5])  # shares of 150 and 50 N m
    >>> info["torque"].tolist(), round(float(info["tip_error"]), 2)
    ([150.0, -25.0], 0.03)
"""

from __future__ import annotations

from typing import Any, Unpack

import gymnasium
import numpy as np
from gymnasium.envs.registration import EnvSpec
from numpy.typing import ArrayLike, NDArray

from flexarm_env.envs.batch import BatchSimulator
from flexarm_env.envs.documentation import specification
from flexarm_env.envs.info import Episode, InfoMaker, episodes
from flexarm_env.envs.option_types import EnvOptions
from flexarm_env.envs.registration import warn_of_short_limit
from flexarm_env.envs.reset_options import reset_requests_of
from flexarm_env.envs.scene import Scene
from flexarm_env.envs.seeding import generator_words, new_keys, set_generator
from flexarm_env.envs.settings import Settings
from flexarm_env.envs.states import GENERATOR, Words
from flexarm_env.simulation.arm import FlexibleArm
from flexarm_env.validation import choice, finite_array, real_array, shown

RENDER_MODES = ("rgb_array", "human")
FASTEST_VIDEO = 100  # [1/s]; a picture is drawn for each step, and slower control plays in real time


class FlexArmEnvBase:
    """Properties that single and vector environments have in common."""

    simulator: BatchSimulator
    spec: EnvSpec | None
    _started: bool

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

    def _spaces(self) -> tuple[Any, Any]:
        """Return the spaces of one environment's observation and action."""
        bound = self.simulator.layout.bound
        observation = gymnasium.spaces.Box(-bound, bound, dtype=np.float32)
        return observation, gymnasium.spaces.Box(-1.0, 1.0, (len(self.settings.action_limit),), np.float32)

    def _fps(self) -> int:
        """Return the pictures a second: one for each control period, at most `FASTEST_VIDEO` [1/s]."""
        return min(FASTEST_VIDEO, max(1, round(1.0 / self.settings.control_period)))

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
        return np.full(len(self.settings.action_limit), self.settings.mode.mirror, dtype=np.float32)

    def mirror_observation(self, observation: ArrayLike) -> NDArray[np.float32]:
        """Return what the mirrored arm observes; mirroring twice gives the observation back.

        Args:
            observation: one, or any number of them. Shape (..., k).

        Raises:
            ValueError: for another shape.
        """
        return _mirrored("observation", observation, self.observation_mirror)

    def mirror_action(self, action: ArrayLike) -> NDArray[np.float32]:
        """Return the action that does to the mirrored arm what this one does to the arm.

        Args:
            action: one, or any number of them. Shape (..., channels).

        Raises:
            ValueError: for another shape.
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
        """Control periods in a lap."""
        return max(1, round(self.settings.lap_time / self.settings.control_period))


class FlexArmEnv(FlexArmEnvBase, gymnasium.Env[NDArray[np.float32], NDArray[np.float32]]):
    """A very flexible two-link arm whose tip tracks a path; see docs/environments for each id.

    The set-up is that of Green & Sasiadek, *Control of a flexible robot using fuzzy logic and a noncollocated sensor*
    (IFAC 2008): two links of 4.5 m, no gravity; the tip should follow a square of 12.6 m in 16 s. What an action is,
    what an observation holds, what is random and what is rewarded are options (`flexarm_env.envs.settings.Settings`);
    the ids differ in their options only.
    """

    # The tables of the specification come from the declarations.
    __doc__ = specification(__doc__ or "")

    metadata = {"render_modes": list(RENDER_MODES), "render_fps": FASTEST_VIDEO}  # noqa: RUF012  (Gymnasium's own)

    def __init__(self, render_mode: str | None = None, **options: Unpack[EnvOptions]) -> None:
        """Lay out the environment.

        Args:
            render_mode: "rgb_array", "human" or None.
            **options: fields of `Settings`.

        Raises:
            TypeError, ValueError: for a bad argument, naming it, its value and what is allowed.
        """
        if render_mode is not None:
            choice("render_mode", render_mode, RENDER_MODES)
        self.render_mode = render_mode
        self.simulator = self._simulator_of(Settings.of(options, type(self).__name__))
        self.metadata = self.metadata | {"render_fps": self._fps()}
        self.observation_space, self.action_space = self._spaces()
        self._infos = InfoMaker(self.simulator)
        self._scene = None if render_mode is None else Scene(self.simulator, 0, render_mode, self._fps())
        self._begin = np.zeros(1, dtype=np.int64)
        self._shape: tuple[int, ...] = self.action_space.shape or ()
        self._started = False
        self._limit_checked = False

    @property
    def episode(self) -> Episode:
        """Description of the present episode.

        Raises:
            AttributeError: before the first reset.
        """
        self._check_begun()
        return episodes(self.simulator).one(0)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Begin an episode.

        Args:
            seed: seed of `np_random`, which determines all that is random in the episodes; None: no new seed.
            options: see `flexarm_env.envs.reset_options.OPTIONS`; an unknown key raises `ValueError`.
        """
        reset_requests = reset_requests_of(options, self.simulator)
        super().reset(seed=seed)  # refuses a bad seed before it changes anything
        self._check_time_limit()
        self.simulator.start(new_keys(self.np_random, 1), self._begin, reset_requests)
        self._started = True
        if self._scene is not None:
            result = self.simulator.result(0)
            self._scene.begin(result)
            self._show(result)
        return self.simulator.single_observation.copy(), self._infos.read()

    def step(self, action: NDArray[np.float32]) -> tuple[NDArray[np.float32], float, bool, bool, dict[str, Any]]:
        """Hold the action for one control period.

        Args:
            action: in [-1, 1]; beyond that it is limited (Gaussian policies leave the range). Other numbers than
                float32, the action space's, are rounded to it. Shape (channels,).

        Raises:
            ValueError: for another shape, or a value that is not finite.
            RuntimeError: before the first reset.
        """
        if not self._started:
            raise RuntimeError("step() before reset(): there is no state to advance")
        simulator = self.simulator
        try:
            simulator.single_action[:] = action
            taken = True
        except (TypeError, ValueError, BufferError, NotImplementedError):  # not float32, or not of this shape
            taken = False
        if not taken:
            simulator.single_action[:] = rounded(finite_array("action", action, self._shape))
        # A local name makes the call of a function that is an instance's attribute faster.
        advance, infos = simulator.single_step, self._infos
        if not advance():
            finite_array("action", action, self._shape)  # raises the error that names what is wrong
        read, (reward, status) = infos.read, simulator.single_end
        info, terminated = read(), status != 0.0
        if terminated:
            info["end_code"] = infos.codes[status]
        if self._scene is not None:
            result = simulator.result(0)
            self._scene.add(result)
            self._show(result)
        return simulator.single_observation.copy(), reward, terminated, False, info

    def get_state(self) -> Words:
        """Return all that decides how the episode goes on, and what is random after it. Shape (k,), uint64.

        A wrapper's memory, such as the count of Gymnasium's time limit, is not part of it.

        Raises:
            RuntimeError: before the first reset.
        """
        if not self._started:
            raise RuntimeError("get_state() before reset(): there is no state")
        return self.simulator.get_states(self._begin, generator_words(self.np_random)[None])[0]

    def set_state(self, state: Words) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Go on from a state, to the last bit.

        Args:
            state: of an environment with the same options, single or in a batch (`get_state`). Limits, gains, noise,
                weights of the reward and ranges of draws may differ; those of this environment count. Shape (k,).

        Returns:
            Observation and info of the state.

        Raises:
            TypeError, ValueError: for anything else, or the state of an environment with other options.
            RuntimeError: before the first reset.
        """
        if not self._started:
            raise RuntimeError("set_state() before reset(): call reset() once")
        (own,) = self.simulator.set_states(state, self._begin)
        set_generator(self.np_random, own[GENERATOR])
        if self._scene is not None:
            self._scene.begin(self.simulator.result(0))
        return self.simulator.single_observation.copy(), self._info()[0]

    def _info(self) -> tuple[dict[str, Any], bool]:
        """Return the info of the present instant, and whether the episode has terminated."""
        info, (_, status) = self._infos.read(), self.simulator.single_end
        if status != 0.0:
            info["end_code"] = self._infos.codes[status]
        return info, status != 0.0

    def render(self) -> NDArray[np.uint8] | None:
        """Draw the present instant. Shape (size, size, 3); None in "human" mode, where a window shows it.

        Raises:
            gymnasium.error.DependencyNotInstalled: without pygame-ce, naming the extra.
        """
        if self._scene is None:
            gymnasium.logger.warn(
                f'render() without a render mode; give make one, e.g. render_mode="{RENDER_MODES[0]}"'
            )
            return None
        if not self._started:
            raise RuntimeError("render() before reset(): there is nothing to show")
        return self._scene.draw(self.simulator.result(0))

    def close(self) -> None:
        """Close the window, if there is one."""
        if self._scene is not None:
            self._scene.close()

    def _simulator_of(self, settings: Settings) -> BatchSimulator:
        """Return the arm, and what is around it."""
        return BatchSimulator(settings, 1)

    def _check_time_limit(self) -> None:
        """Warn once if the registered time limit ended the episode before a lap was complete.

        The limit is that of Gymnasium's wrapper. `make` does not pass it on, so that it is seen at the next reset only.
        """
        if self._limit_checked or not self._started:
            return
        self._limit_checked = True
        result, parts = self.simulator.result(0), self.simulator.parts
        if result[parts["STATUS"]] == 0.0:
            steps = round(result[parts["TIME"]].item() / self.control_period)
            warn_of_short_limit(self.spec, steps, self.lap_steps)

    def _show(self, result: NDArray[np.float64]) -> None:
        if self.render_mode == "human" and self._scene is not None:
            self._scene.draw(result)


def _mirrored(name: str, values: ArrayLike, signs: NDArray[np.float32]) -> NDArray[np.float32]:
    numbers = real_array(name, values).astype(np.float32)
    if numbers.shape[-1:] != signs.shape:
        raise ValueError(f"{name}: must have shape (..., {len(signs)}), got {numbers.shape}")
    return numbers * signs


def rounded(actions: NDArray[Any]) -> NDArray[np.float32]:
    """Convert actions to the action space's float32, limited first: a float64 may exceed the range of float32."""
    limited = np.minimum(np.maximum(actions.astype(np.float64), -1.0), 1.0)  # faster than `np.clip`
    return limited.astype(np.float32)

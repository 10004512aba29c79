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
from numpy.typing import NDArray

from flexarm_env.envs.base import FASTEST_VIDEO, FlexArmEnvBase, rounded
from flexarm_env.envs.batch import BatchSimulator
from flexarm_env.envs.documentation import specification
from flexarm_env.envs.info import Episode, episodes
from flexarm_env.envs.option_types import EnvOptions
from flexarm_env.envs.registration import warn_of_short_limit
from flexarm_env.envs.rendering import RENDER_MODES
from flexarm_env.envs.seeding import generator_words, new_keys, set_generator
from flexarm_env.envs.settings import Settings
from flexarm_env.envs.states import GENERATOR, Words
from flexarm_env.validation import choice, finite_array


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
        """
        if render_mode is not None:
            choice("render_mode", render_mode, RENDER_MODES)
        simulator = self._simulator_of(Settings.of(options, type(self).__name__))
        self.observation_space, self.action_space = self._lay_out(simulator, render_mode)
        self._begin = np.zeros(1, dtype=np.int64)
        self._shape: tuple[int, ...] = self.action_space.shape or ()
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
        reset_requests = self._requests(options)
        super().reset(seed=seed)  # refuses a bad seed before it changes anything
        self._check_time_limit()
        self.simulator.start(new_keys(self.np_random, 1), self._begin, reset_requests)
        self._started = True
        self._remember(self._begin)
        return self.simulator.single_observation.copy(), self._infos.read()

    def step(self, action: NDArray[np.float32]) -> tuple[NDArray[np.float32], float, bool, bool, dict[str, Any]]:
        """Hold the action for one control period.

        Args:
            action: in [-1, 1]; beyond that it is limited (Gaussian policies leave the range). Other numbers than
                float32, the action space's, are rounded to it. Shape (channels,).

        Raises:
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
        if self._judges:
            self._judge(simulator.single_result[None])
        read, (reward, status) = infos.read, simulator.single_end
        info, terminated = read(), status != 0.0
        if terminated:
            info["end_code"] = infos.codes[status]
        if self._scenes:
            self._remember()
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
        for scene in self._scenes:
            scene.begin(self.simulator.result(0))
        info, (_, status) = self._infos.read(), self.simulator.single_end
        info["end_code"] = self._infos.codes[status]
        return self.simulator.single_observation.copy(), info

    def render(self) -> NDArray[np.uint8] | None:
        """Draw the present instant. Shape (size, size, 3); None in "human" mode, where a window shows it.

        Raises:
            gymnasium.error.DependencyNotInstalled: without pygame-ce, naming the extra.
            RuntimeError: before the first reset.
        """
        return self._scenes[0].draw(self.simulator.result(0)) if self._begun_drawing() else None

    def close(self) -> None:
        """Close the window, if there is one."""
        for scene in self._scenes:
            scene.close()

    def _simulator_of(self, settings: Settings) -> BatchSimulator:
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

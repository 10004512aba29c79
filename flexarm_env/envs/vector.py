"""`FlexArmVectorEnv`: many arms as one Gymnasium vector environment, on the kernels of the single one.

Three arms with different payloads:

    >>> import gymnasium
    >>> import numpy as np
    >>> import flexarm_env
    >>> arms = [{"payload_mass": mass} for mass in (0.0, 0.5, 1.0)]
    >>> envs = gymnasium.make_vec("FlexArm/Square-v0", num_envs=3, per_env={"arm": arms})
    >>> observations, infos = envs.reset(seed=0)
    >>> observations, rewards, terminated, truncated, infos = envs.step(np.zeros((3, 2)))
    >>> observations.shape, infos["tip_error"].shape
    ((3, 46), (3,))
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import isfinite
from typing import Any, Unpack

import gymnasium
import numpy as np
from gymnasium.envs.registration import EnvSpec
from gymnasium.vector import AutoresetMode
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from flexarm_env.envs.base import FASTEST_VIDEO, NOBODY, FlexArmEnvBase, rounded
from flexarm_env.envs.batch import BatchSimulator
from flexarm_env.envs.info import Episode, episodes, masked
from flexarm_env.envs.option_types import EnvOptions
from flexarm_env.envs.per_env import settings_of_each
from flexarm_env.envs.registration import warn_of_short_limit
from flexarm_env.envs.rendering import RENDER_MODES
from flexarm_env.envs.seeding import EpisodeKeys
from flexarm_env.envs.states import GENERATOR, Words
from flexarm_env.validation import choice, entries, finite_array, integer, mapping, real_array, shown

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]
Indices = NDArray[np.int64]
MOST = 10**15  # control periods, environments; a float64 counts them one by one
Step = tuple[NDArray[np.float32], Array, Flags, Flags, dict[str, Any]]


class FlexArmVectorEnv(
    FlexArmEnvBase, gymnasium.vector.VectorEnv[NDArray[np.float32], NDArray[np.float32], NDArray[Any]]
):
    """N environments in one; environment i of a batch seeded s is the single one seeded s + i, to the last bit.

    With `per_env`, that single one has the options of environment i.

    Attributes:
        simulator: arms, kernels and memory.
        autoreset_mode: when a finished environment begins its next episode.
    """

    metadata = {  # noqa: RUF012  (Gymnasium's own declaration)
        "render_modes": list(RENDER_MODES[:1]),
        "render_fps": FASTEST_VIDEO,
        "autoreset_mode": AutoresetMode.NEXT_STEP,
    }
    # Gymnasium closes a batch that Python deletes. Until one is made, or read from a pickle, there is nothing to close.
    closed = True
    _spec: EnvSpec | None = None

    def __init__(
        self,
        num_envs: int = 1,
        max_episode_steps: int | None = None,
        render_mode: str | None = None,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        threads: int = 1,
        per_env: Mapping[str, Sequence[Any]] | None = None,
        **options: Unpack[EnvOptions],
    ) -> None:
        """Lay out the batch.

        Args:
            num_envs: number of environments.
            max_episode_steps: number of control periods after which an episode is truncated; None or -1: never.
            render_mode: "rgb_array" or None.
            autoreset_mode: a finished environment begins a new episode at the next step ("NextStep"), in the step that
                ends it ("SameStep": see `final_obs` and `final_info`), or at a reset by the caller ("Disabled").
            threads: number of threads that share the work; more than one pays off for large batches on idle cores.
            per_env: options that differ between the environments: a sequence with a value for each environment, by the
                option's name, one of `flexarm_env.envs.per_env.OPTIONS`.
            **options: fields of `Settings`, for all environments.
        """
        self.num_envs = integer("num_envs", num_envs, 1, MOST)
        limit = None if max_episode_steps in (None, -1) else integer("max_episode_steps", max_episode_steps, 1, MOST)
        if render_mode is not None:
            choice("render_mode", render_mode, RENDER_MODES[:1])
        mode = autoreset_mode.value if isinstance(autoreset_mode, AutoresetMode) else autoreset_mode
        self.autoreset_mode = AutoresetMode(choice("autoreset_mode", mode, [each.value for each in AutoresetMode]))
        each = settings_of_each(options, per_env, self.num_envs, type(self).__name__)
        simulator = BatchSimulator(each, self.num_envs, integer("threads", threads, 1))
        self.single_observation_space, self.single_action_space = self._lay_out(simulator, render_mode)
        self.metadata = self.metadata | {"autoreset_mode": self.autoreset_mode}
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        self.action_space = batch_space(self.single_action_space, self.num_envs)
        self._keys = EpisodeKeys(self.num_envs)
        self._limit = limit
        self._longest = np.inf if limit is None else (limit - 0.5) * self.control_period  # [s], whatever the rounding
        self._ended = NOBODY  # environments whose episode is over
        parts = simulator.parts
        self._reward, self._status, self._time = (parts[name].start for name in ("REWARD", "STATUS", "TIME"))
        self.closed = False

    def __repr__(self) -> str:
        """Describe the batch in a line."""
        alike = all(one is self.settings for one in self.simulator.each)
        return self._described(f"num_envs={self.num_envs}", *(() if alike else ("per_env",)))

    @property
    def spec(self) -> EnvSpec | None:
        """Spec from which `make_vec` made the batch."""
        return self._spec

    @spec.setter
    def spec(self, spec: EnvSpec | None) -> None:
        self._spec = spec
        warn_of_short_limit(spec, self._limit, self.lap_steps)

    @property
    def episode(self) -> Episode:
        """Description of the present episodes: arrays of shape (N,).

        Raises:
            AttributeError: before the first reset.
        """
        self._check_begun()
        return episodes(self.simulator)

    # --- Gymnasium's interface -------------------------------------------------------------------------------------

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Begin episodes.

        Args:
            seed: environment i is seeded with seed + i, or with entry i of a sequence.
            options: keys of `flexarm_env.envs.reset_options.OPTIONS` with a value for all environments or one for each;
                and `reset_mask`, the environments that begin an episode. Shape (N,), bool.
        """
        wanted = mapping("options", {} if options is None else options)
        mask = self._mask(wanted.pop("reset_mask", None))
        reset_requests = self._requests(wanted)
        self._seed(seed, mask)  # refuses a bad seed before it changes anything
        begun = np.flatnonzero(mask)
        self.simulator.start(self._keys.take(begun), begun, reset_requests)
        self._started, self._ended = True, self._ended[~mask[self._ended]]
        self._remember(begun, moved=False)
        infos = self._infos.batch()
        return self._observations(), infos if len(begun) == self.num_envs else masked(infos, mask)

    def step(self, actions: NDArray[np.float32]) -> Step:
        """Hold each environment's action for one control period.

        Args:
            actions: values in [-1, 1]; beyond that they are limited. Actions of environments that begin an episode in
                this step are not read. Other types than float32 are converted. Shape (N, channels).

        Raises:
            RuntimeError: before the first reset, or for a finished environment where nothing resets it.
        """
        if not self._started:
            raise RuntimeError("step() before reset(): there are no states to advance")
        self._take(actions)
        if self.autoreset_mode is AutoresetMode.DISABLED and len(self._ended):
            raise RuntimeError(
                f"step() after the end of episode {self._ended[0]}: with autoreset_mode = 'Disabled' call "
                "reset(options={'reset_mask': ...}) first"
            )
        begun = self._ended  # empty except with next-step reset
        if len(begun):
            self.simulator.request_resets(self._keys.take(begun), begun, self._requests())
        self.simulator.step()
        results = self.simulator.results
        if self._judges:
            self._judge(results, begun)
        status = results[:, self._status]
        terminated = status != 0.0
        truncated = results[:, self._time] > self._longest
        if len(begun):  # an episode ends after a step at the earliest
            terminated[begun] = False
        rewards = results[:, self._reward].copy()  # 0 where an episode begins
        self._ended = (terminated | truncated).nonzero()[0]
        infos = self._infos.batch()
        if len(self._ended):
            infos["end_code"][self._ended] = [self._infos.codes[each] for each in status[self._ended].tolist()]
            if self.autoreset_mode is AutoresetMode.SAME_STEP:
                begun, self._ended = self._ended, NOBODY
                infos = self._restart(begun, infos)
        self._remember(begun)
        return self._observations(), rewards, terminated, truncated, infos

    def get_state(self, rows: Sequence[int] | Indices | None = None) -> Words:
        """Return the states of environments; see `FlexArmEnv.get_state`. Shape (n, k), uint64.

        Args:
            rows: indices of the environments; None: all.

        Raises:
            RuntimeError: before the first reset.
        """
        chosen = self._chosen("get_state", rows)
        return self.simulator.get_states(chosen, self._keys.words(chosen))

    def set_state(
        self, state: Words, rows: Sequence[int] | Indices | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Let environments go on from states, to the last bit; see `FlexArmEnv.set_state`.

        An environment that is set to an ended episode begins the next one as `autoreset_mode` says.

        Args:
            state: one for all of these environments, or one for each. Shape (k,) or (n, k).
            rows: indices of the environments that are set; None: all.

        Returns:
            Observations and infos of all environments.

        Raises:
            TypeError, ValueError: for anything else, or states of environments with other options.
            RuntimeError: before the first reset.
        """
        chosen = self._chosen("set_state", rows)
        own = self.simulator.set_states(state, chosen)
        self._keys.set_words(chosen, own[:, GENERATOR])
        results = self.simulator.results
        status = results[:, self._status]
        over = np.zeros(self.num_envs, dtype=bool)
        over[self._ended] = True
        over[chosen] = (status[chosen] != 0.0) | (results[chosen, self._time] > self._longest)
        self._ended = over.nonzero()[0]
        self._remember(chosen, moved=False)
        infos = self._infos.batch()
        infos["end_code"][self._ended] = [self._infos.codes[each] for each in status[self._ended].tolist()]
        return self._observations(), infos

    def render(self) -> tuple[NDArray[np.uint8], ...] | None:
        """Draw each environment. Shape (size, size, 3) each; None without a render mode.

        Raises:
            RuntimeError: before the first reset.
        """
        if not self._begun_drawing():
            return None
        return tuple(scene.draw(self.simulator.result(i)) for i, scene in enumerate(self._scenes))  # type: ignore[misc]

    def close_extras(self, **kwargs: Any) -> None:
        """Close threads and windows."""
        for scene in self._scenes:
            scene.close()
        self.simulator.close()

    @property
    def np_random_seed(self) -> tuple[int, ...]:  # type: ignore[override]
        """Seeds of the environments, as `SyncVectorEnv` has them; () before the first reset."""
        return tuple(self._keys.seeds)

    # --- inside ----------------------------------------------------------------------------------------------------

    def _mask(self, mask: Any) -> Flags:
        if mask is None:
            return np.ones(self.num_envs, dtype=bool)
        flags = np.asarray(mask)
        if flags.shape != (self.num_envs,) or flags.dtype != np.bool_ or not flags.any():
            raise ValueError(
                f"options['reset_mask'] = {shown(mask)}: "
                f"must be a bool array of shape ({self.num_envs},), one True at least"
            )
        if not self._started and not flags.all():
            raise ValueError("options['reset_mask']: the first reset must begin an episode in every environment")
        return flags.copy()

    def _seed(self, seed: int | Sequence[int | None] | None, mask: Flags) -> None:
        """Seed generators as `SyncVectorEnv` does: seed + i, or one seed each; None leaves a generator as it is."""
        given = entries(seed)
        if given is None:
            first = None if seed is None else integer("seed", seed, 0)
            given = [None if first is None else first + i for i in range(self.num_envs)]
        elif len(given) != self.num_envs:
            raise ValueError(f"seed: must be one number or {self.num_envs}, got {len(given)}")
        self._keys.seed(
            [each if each is None else integer(f"seed[{i}]", each, 0) for i, each in enumerate(given)], mask
        )

    def _take(self, actions: NDArray[np.float32]) -> None:
        values = actions if type(actions) is np.ndarray else real_array("actions", actions)
        if values.shape != self.action_space.shape or values.dtype.kind not in "fiu":
            finite_array("actions", actions, self.action_space.shape or ())  # raises the error that names what is wrong
        if not isfinite(np.vdot(values, values)):  # a value is not finite, or a square overflows; check each value
            read = np.ones(len(values), dtype=bool)
            read[self._ended] = False
            finite_array("actions", np.where(read[:, None], values, 0.0), self.action_space.shape or ())
        self.simulator.actions[: self.num_envs] = values if values.dtype == np.float32 else rounded(values)

    def _restart(self, ended: Indices, infos: dict[str, Any]) -> dict[str, Any]:
        """Begin new episodes where one ended in this step; return infos with `final_obs` and `final_info`."""
        final_obs = np.empty(self.num_envs, dtype=object)
        for i in ended.tolist():
            final_obs[i] = self.simulator.observations[i].copy()
        self.simulator.start(self._keys.take(ended), ended, self._requests())
        merged = self._infos.batch()
        done = np.zeros(self.num_envs, dtype=bool)
        done[ended] = True
        merged |= {"final_obs": final_obs, "_final_obs": done.copy()}
        merged |= {"final_info": masked(infos, done), "_final_info": done.copy()}
        return merged

    def _observations(self) -> NDArray[np.float32]:
        return self.simulator.observations[: self.num_envs].copy()

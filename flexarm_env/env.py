"""`FlexArmEnv`: the Gymnasium environment of the paper's set-up. Glue only."""

from __future__ import annotations

from collections.abc import Mapping
from math import isfinite
from typing import Any

import gymnasium
import numpy as np
from numpy.typing import NDArray

from flexarm_env.actions import scaled
from flexarm_env.arm import FlexibleArm
from flexarm_env.parameters import (
    WAVE_SPEED,
    ArmParameters,
    Compensation,
    Corner,
    Delayed,
    Direction,
    ElbowBranch,
    LawParameters,
    RateJacobian,
    SensorModel,
    SensorParameters,
    SquareParameters,
)
from flexarm_env.reward import TERMS as REWARD_TERMS
from flexarm_env.simulation import LoopCase, Results
from flexarm_env.task import ANGLE_LIMIT, RATE_LIMIT, square_loop, state_limits
from flexarm_env.validation import choice, finite_array, number


class FlexArmEnv(gymnasium.Env[NDArray[np.float32], NDArray[np.float32]]):
    """A very flexible two-link arm tracks a square under the Jacobian-transpose law, whose gain is the action.

    ## Description

    The set-up of Green & Sasiadek, *Control of a flexible robot using fuzzy logic and a noncollocated sensor* (IFAC
    2008): two links of 4.5 m, one vibration mode each, no gravity; the tip should follow a square of 12.6 m, centred
    on the shoulder, in 16 s. The torque is ``lambda J^T (Kp e + Kd e')`` (10), (14), with e the error of a sensor on
    link 2 that may sit off the joints and be late. The law acts in continuous time; the agent sets lambda every ms.

    ## Action space

    `Box(-1, 1, (1,), float32)`, mapped to lambda in [0, `gain_limit`] by `flexarm_env.actions.gain_from_action`
    and held for 1 ms. Values outside [-1, 1] are clipped (agents' Gaussian samples leave it); values that are not
    finite raise `ValueError`.

    ## Observation space

    `Box(..., (10 + 2 m,), float32)` with m modes a link (paper: 1); the slices are in `observation_blocks`.

    | block | numbers | what | unit |
    |---|---|---|---|
    | `joint_angles` | 2 | theta1, theta2 | rad |
    | `joint_rates` | 2 | their rates | rad/s |
    | `sensed_position` | 2 | the sensor's reading as x, y: late, noisy | m |
    | `modal_coordinates` | 2 m | link 1's, link 2's: strain-gauge readings | 1 |
    | `reference_position` | 2 | where the tip should be | m |
    | `reference_velocity` | 2 | | m/s |

    ## Reward

    ``0.5 exp(-(e / 0.6 m)^2) + 0.5 exp(-e / 0.15 m)`` with e the distance of the *true* tip (with deflection) from
    the reference after the step; the terms are in `info["reward_terms"]`.

    ## Starting state

    At rest, straight links, the rigid tip on the start corner. With `noise`, the readings depend on the seed.

    ## Episode end

    Termination, with `info["termination_reason"]`: `"diverged"` (the state stopped being finite), `"angle"` (a joint
    turned more than four times), `"rate"` (beyond 1000 rad/s), `"deflection"` (a modal coordinate that alone bends
    its link's tip by the link's length). Truncation by the registered limit of 16 000 steps, one lap of 16 s; with
    another `lap_time` give `gymnasium.make` the `max_episode_steps` that fit it. Laps follow each other without it.

    ## Info

    `time` [s], `gain` (lambda of the period that ends), `torque` (at its start [N m]), `true_tip`, `rigid_tip`,
    `reference`, `sensed` [m], `state` (`FlexibleArm`'s order).

    ## Arguments

    ```python
    gymnasium.make("flexarm_env:FlexArm/Paper-v0", sensor_position=0.5, compensation="shared")
    ```

    | argument | default | see |
    |---|---|---|
    | `arm` | "paper" | below |
    | `sensor` | "rigid" | `SensorParameters.model` |
    | `sensor_position`, `delay`, `delayed` | 4.5 m, by wave speed, "position" | `SensorParameters` |
    | `rate_jacobian`, `noise`, `wave_speed` | "delayed", 0 m, 288.33 m/s | `SensorParameters` |
    | `compensation`, `torque_limit` | "none", none | `LawParameters` |
    | `proportional_gain`, `derivative_gain` | 150.79 N/m, 17.364 N s/m | `LawParameters` |
    | `gain_limit` | 1 | lambda at action 1 |
    | `side`, `lap_time` | 12.6 m, 16 s | `SquareParameters` |
    | `start_corner`, `direction`, `elbow_branch` | "lower left", "clockwise", "positive" | `SquareParameters` |
    | `physics_step` | as the arm's fastest mode demands | `ClosedLoop` |

    `arm` is "paper", "default" (2 modes, complete dynamics, 1 % damping), or a mapping of `ArmParameters` fields,
    with `preset` ("paper" unless given) for the fields that it does not set.

    ## Version history

    v0: first version.
    """

    metadata = {"render_modes": []}  # noqa: RUF012  (Gymnasium's own declaration)

    def __init__(
        self,
        arm: str | Mapping[str, Any] = "paper",
        sensor: SensorModel = "rigid",
        sensor_position: float = 4.5,
        delay: float | tuple[float, float] | None = None,
        delayed: Delayed = "position",
        rate_jacobian: RateJacobian = "delayed",
        noise: float = 0.0,
        wave_speed: float = WAVE_SPEED,
        compensation: Compensation = "none",
        torque_limit: tuple[float, float] | None = None,
        proportional_gain: float = 150.79,
        derivative_gain: float = 17.364,
        gain_limit: float = 1.0,
        side: float = 12.6,
        lap_time: float = 16.0,
        start_corner: Corner = "lower left",
        direction: Direction = "clockwise",
        elbow_branch: ElbowBranch = "positive",
        physics_step: float | None = None,
        render_mode: None = None,
    ) -> None:
        """Lay out the environment; see the class for the arguments.

        Raises:
            TypeError, ValueError: for a bad argument, naming it, its value and what is allowed.
        """
        if render_mode is not None:
            raise ValueError(f"render_mode = {render_mode!r}: this environment does not render; it must be None")
        self.render_mode = render_mode
        self.arm = FlexibleArm(arm_parameters(arm))
        sensor_parameters = SensorParameters(sensor, sensor_position, delay, delayed, rate_jacobian, noise, wave_speed)
        law = LawParameters(proportional_gain, derivative_gain, compensation, torque_limit)
        task = SquareParameters(side, lap_time, start_corner, direction, elbow_branch)
        self.gain_limit = number("gain_limit", gain_limit, above=0.0)
        self._noise = sensor_parameters.noise
        self._loop, self._start = square_loop(self.arm, [LoopCase(sensor_parameters, law)], task, physics_step)
        self.observation_blocks = observation_blocks(self.arm.parameters.modes_per_link)
        bound = _observation_bound(self.arm, sensor_parameters, task)
        self.observation_space = gymnasium.spaces.Box(-bound, bound, dtype=np.float32)
        self.action_space = gymnasium.spaces.Box(-1.0, 1.0, (1,), np.float32)

    @property
    def lap_steps(self) -> int:
        """Control periods in a lap."""
        return round(self._loop.path.lap_time / self._loop.control_period)

    @property
    def control_period(self) -> float:
        """The gain is held so long [s]."""
        return self._loop.control_period

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Start a lap.

        Args:
            seed: of the sensor noise.
            options: none are known; any key raises `ValueError`.
        """
        super().reset(seed=seed)
        if options:
            raise ValueError(f"options = {options!r}: no option is known; it must be None or empty")
        self._loop.reset(self._start, self._draw())
        results = self._loop.results()
        self._observation = results.observation[0].astype(np.float32)
        return self._observation.copy(), self._info(results, gain=0.0)

    def step(self, action: NDArray[np.float32]) -> tuple[NDArray[np.float32], float, bool, bool, dict[str, Any]]:
        """Hold the action's gain for one control period; see the class."""
        if np.shape(action) != (1,) or not isfinite(action[0]):
            finite_array("action", action, (1,))  # says what is wrong
        gain = scaled(min(max(float(action[0]), -1.0), 1.0), self.gain_limit)
        self._loop.advance((gain,), self._draw())
        results = self._loop.results()
        info = self._info(results, gain)
        reason = self._loop.failure(float(results.status[0]))
        if reason is not None:
            info["termination_reason"] = reason
            # the state may be anything now: the observation stays at the last valid one
            return self._observation.copy(), 0.0, True, False, info
        self._observation = results.observation[0].astype(np.float32)
        info["reward_terms"] = dict(zip(REWARD_TERMS, results.reward_terms[0].tolist(), strict=True))
        return self._observation.copy(), sum(info["reward_terms"].values()), False, False, info

    def _draw(self) -> NDArray[np.float64] | None:
        return self.np_random.normal(0.0, self._noise, (1, 2)) if self._noise > 0.0 else None

    def _info(self, results: Results, gain: float) -> dict[str, Any]:
        return {
            "time": self._loop.time,
            "gain": gain,
            "torque": results.torque[0],
            "reference": results.observation[0, self.observation_blocks["reference_position"]],
            "sensed": results.observation[0, self.observation_blocks["sensed_position"]],
            "true_tip": results.true_tip[0],
            "rigid_tip": results.rigid_tip[0],
            "state": results.state[0],
        }


def arm_parameters(arm: str | Mapping[str, Any]) -> ArmParameters:
    """The arm that an environment's `arm` argument stands for.

    Raises:
        TypeError: for anything but a name or a mapping.
        ValueError: for another name, or a field that `ArmParameters` does not have.
    """
    if isinstance(arm, str):
        arm = {"preset": arm}
    if not isinstance(arm, Mapping):
        raise TypeError(f"arm = {arm!r}: must be 'paper', 'default' or a mapping of ArmParameters fields")
    fields = dict(arm)
    preset = choice("arm", fields.pop("preset", "paper"), ("paper", "default"))
    known = ArmParameters.__dataclass_fields__
    unknown = [name for name in fields if name not in known]
    if unknown:
        raise ValueError(f"arm: unknown field(s) {unknown}; ArmParameters has {list(known)}, and there is 'preset'")
    return ArmParameters.paper(**fields) if preset == "paper" else ArmParameters(**fields)


def observation_blocks(modes: int) -> dict[str, slice]:
    """Where each named block lies in an observation (`closed_loop.Outputs`)."""
    sizes = {
        "joint_angles": 2,
        "joint_rates": 2,
        "sensed_position": 2,
        "modal_coordinates": 2 * modes,
        "reference_position": 2,
        "reference_velocity": 2,
    }
    ends = np.cumsum(list(sizes.values())).tolist()
    return {name: slice(end - size, end) for (name, size), end in zip(sizes.items(), ends, strict=True)}


def _observation_bound(arm: FlexibleArm, sensor: SensorParameters, task: SquareParameters) -> NDArray[np.float32]:
    """Magnitudes that the observation cannot pass before the episode terminates."""
    length1, length2 = arm.parameters.link_lengths
    # deflections of up to m times a link's length bend the true point away; 10 standard deviations of noise
    bend = arm.parameters.modes_per_link * (length1 + length2) if sensor.model == "true" else 0.0
    sensed = length1 + sensor.position + bend + 10.0 * sensor.noise
    bounds = {
        "joint_angles": np.full(2, ANGLE_LIMIT),
        "joint_rates": np.full(2, RATE_LIMIT),
        "sensed_position": np.full(2, sensed),
        "modal_coordinates": state_limits(arm)[2 : arm.size],
        "reference_position": np.full(2, 0.5 * task.side),
        "reference_velocity": np.full(2, 4.0 * task.side / task.lap_time),
    }
    values = np.concatenate(list(bounds.values()))
    # rounded outwards: the float32 of a value at the bound must not pass it
    return np.nextafter(values.astype(np.float32), np.float32(np.inf))

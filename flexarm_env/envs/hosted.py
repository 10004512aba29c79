"""`HostedSimulator`: one environment whose arm is another engine's; the same kernels compute all else.

The kernels do the two halves of a control period (`episode.step.step_half`). In between the plant moves; its state and
readings are written where the kernels of our own arm would write theirs.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from flexarm_env.actions import IDEAL_MOTORS, physical_from_action
from flexarm_env.codegen.arrays import Four
from flexarm_env.codegen.declarations import Program
from flexarm_env.envs.batch import BatchSimulator
from flexarm_env.envs.drawing import Drawing
from flexarm_env.envs.settings import Settings
from flexarm_env.episode.step import HOST_PROGRAMS
from flexarm_env.kernels.delay_line import is_kept
from flexarm_env.kernels.entries import DRAWN, clock_row, word
from flexarm_env.physics.polyline import chord_at
from flexarm_env.physics.sensing import Truth
from flexarm_env.validation import shown

Array = NDArray[np.float64]


class Plant(Protocol):
    """An arm with two motors and sensors, as an environment with some `Settings` needs one."""

    def begin(self, state: Array, quantities: Mapping[str, Any]) -> None:
        """Put the arm into the state in which an episode begins.

        Args:
            state: public state of the settings' arm, whose shapes the plant takes as far as it can. Shape (4 + 4 m,).
            quantities: of the episode (`entries.Drawn`), and what else it has drawn (`options.DRAWABLE`), by name.
        """

    def advance(self, command: Array, reference: Four | None) -> Sequence[float] | Array:
        """Hold a command for one integration step of the settings.

        Args:
            command: torques of shoulder and elbow [N m]; the gain, where the paper's law acts. Shape (channels,).
            reference: where that law acts: at the step's start, and its mean velocity over the step [m, m/s].

        Returns:
            Torques at the start of the step [N m]. Shape (2,).
        """

    def readings(self) -> Array:
        """Return what the sensors would read now without delay and noise.

        Returns:
            Two readings and their rates of the sensor on link 2 (`physics.sensing.reading`), then what the formulas of
            the further sensors give (`physics.sensing.QUANTITIES_AT_A_POINT`). Shape (slot_rows,).
        """

    def encoders(self) -> Array:
        """Return the joints' angles and rates, as the encoders would read them without noise. Shape (4,)."""

    def truth(self) -> Truth:
        """Return the arm's state, tips and deflections now.

        The state is the nearest one of the settings' arm. Strain gauges read its modal coordinates. Its joint angles
        say where the links lie; they differ from the encoders' where the mode shapes cannot follow a link's slope.
        """

    def drawing(self) -> Drawing:
        """Return where its lines are now."""

    def get_state(self) -> Array:
        """Return what decides how it moves on, beside the quantities of the episode. Shape (k,), always the same.

        A plant without this method and `set_state` has environments whose states cannot be copied.
        """

    def set_state(self, state: Array, quantities: Mapping[str, Any]) -> None:
        """Go on from a state that `get_state` has returned in an episode with these quantities, to the last bit."""


class HostedSimulator(BatchSimulator):
    """One environment around another engine's arm.

    Attributes:
        plant: the arm.
    """

    def __init__(self, settings: Settings, plant: Plant) -> None:
        """Lay it out around an arm that is made for these settings.

        Raises:
            ValueError: for an action mode whose law acts within the compiled arm, motors that are not ideal,
                a payload that changes, or pulses.
        """
        if settings.real_motors:
            given = " or ".join(IDEAL_MOTORS)
            raise ValueError(f"{given}: act within the compiled arm; on another engine's arm motors must be ideal")
        if settings.payload_changes or settings.pulsed:
            raise ValueError("payload_changes, pulse_force: act on the compiled arm alone; must be None and 0")
        self.plant = plant
        super().__init__(settings, 1)

    def drawing(self, index: int, result: Array) -> Drawing:
        """See `BatchSimulator.drawing`."""
        return self.plant.drawing()

    def _plant_state(self) -> Array:
        for name in ("get_state", "set_state"):
            method = getattr(self.plant, name, None)
            if method is None or getattr(method, "__func__", None) is getattr(Plant, name):  # the protocol's own
                raise NotImplementedError(
                    f"{type(self.plant).__name__} has no {name}: states of this environment cannot be copied"
                )
        return self.plant.get_state()

    def _set_plant_state(self, state: Array) -> None:
        self.plant.set_state(state, self._quantities())

    # --- inside ----------------------------------------------------------------------------------------------------

    def _program_of(self, settings: Settings) -> Program:
        program = HOST_PROGRAMS.get(settings.mode.program)
        if program is None:
            raise ValueError(
                f"action_mode = {shown(settings.action_mode)}: its law acts within the compiled arm; "
                f"on another engine's arm it must be one of {', '.join(map(repr, HOST_PROGRAMS))}"
            )
        return program

    def _example(self) -> tuple[Any, ...]:
        return self._memory, False

    def _arguments(self) -> tuple[Any, ...]:
        return self.settings, self.plant

    def _link(self) -> None:
        super()._link()
        settings = self.settings
        shape = self.settings.history_slots, self._variant.slot_rows
        self._slots = self._histories.reshape(shape)
        self._arena = self._arenas[0, :, 0]
        first = self._rows["TAIL"][0] + self._header[word.COMMANDS]
        first += self._header[word.KEPT_ACTIONS] * self._header[word.CHANNELS]
        count = settings.substeps * len(settings.action_limit)
        self._commands = self._arena[first : first + count].reshape(settings.substeps, -1)

    def _use(self, kernel: Callable[..., Any]) -> None:
        self._kernel, self.single_step = kernel, self._do_period

    def _do_period(self) -> bool:
        """Do a control period, or the beginning of an episode; False if it refused an action that is not finite."""
        if not self._kernel(self._memory, False):
            return False
        if self._header[word.DRIVING]:
            self._move()
        else:
            self._begin()
        self._enter_truth()
        self._kernel(self._memory, True)
        return True

    def _move(self) -> None:
        """Advance the plant by a control period; its readings go into the delay line, whose head is already there."""
        steps, head = self.settings.substeps, int(self._clocks[0, clock_row.HEAD, 0])
        law = self.settings.mode.law == "tip"
        for done, command in enumerate(self._physical(self._commands), 1):
            torque = self.plant.advance(command, self._chord(done - 1 - steps) if law else None)
            if done == 1:
                self._enter("TORQUE", torque)
                self._enter("EFFECTIVE_GAIN", command[0] if law else 0.0)
            if is_kept(self._header, done):
                self._slots[(head + done - steps) % len(self._slots)] = self.plant.readings()

    def _begin(self) -> None:
        arm = self.settings.flexible_arm
        y, v = (self._part(name) for name in ("Y", "V"))
        self.plant.begin(arm.public_state(np.concatenate([y, v])), self._quantities())
        self._slots[int(self._clocks[0, clock_row.HEAD, 0])] = self.plant.readings()

    def _quantities(self) -> dict[str, Any]:
        """Return the quantities of the episode, and what else it has drawn, by name."""
        drawn = {name: values[0].tolist() for name, values in self.drawn_values().items()}
        return dict(zip(DRAWN, self._part("EPISODE").tolist(), strict=True)) | drawn

    def _chord(self, steps: int) -> Four:
        """Return the reference over an integration step that begins some steps after now."""
        clock, h = self._clocks[0, :, 0], self.settings.control_period / self.settings.substeps
        time, since = float(clock[clock_row.STEPS] + steps) * h, float(clock[clock_row.SINCE]) * h
        return chord_at(self._paths, int(clock[clock_row.PATH]), time, h, since)

    def _physical(self, commands: Array) -> Array:
        """Return commands from shares of what 1 stands for."""
        settings = self.settings
        if settings.mode.accumulates:
            return commands
        limit = tuple(self._part("ACTION_SCALE")[: len(settings.action_limit)].tolist())
        return physical_from_action(settings.action_mode, np.clip(commands, -1.0, 1.0), limit)

    def _enter_truth(self) -> None:
        for name, values in self.plant.truth()._asdict().items():
            self._enter(name.upper(), values)
        self._enter("JOINTS", self.plant.encoders())

    def _enter(self, name: str, values: Any) -> None:
        first, count = self._rows[name]
        self._arena[first : first + count] = values

    def _part(self, name: str) -> Array:
        first, count = self._rows[name]
        return self._arena[first : first + count]

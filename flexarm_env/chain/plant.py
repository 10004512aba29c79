"""`ChainPlant`: the chain as the arm of an environment (`envs.hosted.Plant`).

What an environment requires of an arm is defined here for a chain: encoders read the two motors' hinges; modal
coordinates are those of the environment's arm whose deflection fits the chain's best (`gauges`); tips, deflections and
sensors' points are the chain's own. An episode begins with the bend angles whose fit is the state that was drawn or
requested.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexarm_env.chain.gauges import ChainGauges
from flexarm_env.chain.law import TipLaw
from flexarm_env.chain.links import Chain
from flexarm_env.chain.model import chain_model, stable_steps
from flexarm_env.codegen.arrays import Four
from flexarm_env.envs.drawing import Drawing
from flexarm_env.envs.registration import ChainOptions
from flexarm_env.envs.settings import Settings
from flexarm_env.kernels.entries import DRAWN
from flexarm_env.parameters import SENSOR_MODELS, ArmParameters, arm_parameters
from flexarm_env.physics.coordinates import rigid_tip
from flexarm_env.physics.sensing import Truth

Array = NDArray[np.float64]
MEASURES = {"position": Chain.point, "inertial": Chain.inertial}  # `sensing.QUANTITIES_AT_A_POINT` on a chain


class ChainPlant:
    """The chain as the arm of an environment.

    Attributes:
        chain: that of the present episode.
    """

    chain: Chain

    def __init__(self, settings: Settings, options: ChainOptions) -> None:
        """Build the chain of the settings' arm.

        Raises:
            ValueError: for too few segments, a chain too fast to be integrated, or a law on the late sensor.
        """
        if settings.feedback_source == "sensor":
            raise ValueError(
                "feedback_source = 'sensor': on a chain the paper's law acts on the joints' own angles; "
                "must be 'joints'"
            )
        self._settings, self._options = settings, options
        self._arm = settings.flexible_arm
        self._gauges = ChainGauges(self._arm, options.segments)
        self._step = settings.control_period / settings.substeps
        self._build(self._arm.parameters, settings)

    def begin(self, state: Array, quantities: Mapping[str, Any]) -> None:
        """See `Plant.begin`."""
        self._take(quantities)
        self.chain.pose(*(self._angles(half) for half in np.split(state, 2)))

    def get_state(self) -> Array:
        """See `Plant.get_state`."""
        return self.chain.get_state()

    def set_state(self, state: Array, quantities: Mapping[str, Any]) -> None:
        """See `Plant.set_state`."""
        self._take(quantities)
        self.chain.set_state(state)

    def _take(self, quantities: Mapping[str, Any]) -> None:
        settings = self._settings.having({name: x for name, x in quantities.items() if name not in DRAWN})
        own = arm_parameters(settings.arm)
        factor = quantities["stiffness"]
        first, second = own.flexural_rigidities
        parameters = replace(
            own,
            payload_mass=quantities["payload_mass"],
            damping_ratio=quantities["damping"],
            flexural_rigidities=(factor * first, factor * second),
        )
        if (parameters, settings) != (self.chain.parameters, self._present):
            self._build(parameters, settings)

    def advance(self, command: Array, reference: Four | None) -> Sequence[float] | Array:
        """See `Plant.advance`."""
        if self._law is None or reference is None:
            self.chain.step(command, self._substeps)
            return command
        first, gain, step = None, float(command[0]), self.chain.model.opt.timestep
        x, y, vx, vy = reference
        for n in range(self._substeps):
            now = x + n * step * vx, y + n * step * vy, vx, vy
            torque = self._law.step(gain, now, self.chain.joints())
            first = first or torque
        assert first is not None
        return first

    def readings(self) -> Array:
        """See `Plant.readings`."""
        angles, chain = SENSOR_MODELS[self._settings.sensor].reading == "angles", self.chain
        read = [self.encoders() if angles else chain.point(self._sensor)]
        return np.concatenate([*read, *(MEASURES[name](chain, weights) for name, weights in self._further)])

    def encoders(self) -> Array:
        """See `Plant.encoders`."""
        data, at = self.chain.data, self.chain.shoulder_and_elbow
        return np.concatenate([data.qpos[at], data.qvel[at]])

    def truth(self) -> Truth:
        """See `Plant.truth`."""
        data, at = self.chain.data, self.chain.shoulder_and_elbow
        halves, deflections = [], []
        for angles in (data.qpos, data.qvel):
            bends = angles.reshape(2, -1)[:, 1:]
            modal = [read @ bend for read, bend in zip(self._gauges.modal, bends, strict=True)]
            # theta2 is that of a link 1 whose tip has the fitted slope, so that the state says where link 2 lies
            halves += [angles[at] + [0.0, self._gauges.elbow @ bends[0]], *modal]
            deflections.append([float(row @ bend) for row, bend in zip(self._gauges.deflection, bends, strict=True)])
        return Truth(
            state=list(np.concatenate(halves)),
            true_tip=self.chain.point(self._tip)[:2].tolist(),
            rigid_tip=rigid_tip(self.chain.parameters.link_lengths, data.qpos[at]).tolist(),
            deflection=deflections[0],
            deflection_rate=deflections[1],
        )

    def drawing(self) -> Drawing:
        """See `Plant.drawing`."""
        return Drawing(self.chain.centre_lines(), self.chain.point(self._sensor)[:2])

    # --- inside ----------------------------------------------------------------------------------------------------

    def _build(self, parameters: ArmParameters, settings: Settings) -> None:
        options, self._present = self._options, settings
        model = chain_model(options.segments, parameters)
        self._substeps = stable_steps(model, self._step, options.chain_step)
        model.opt.timestep = self._step / self._substeps
        self.chain = Chain(model, parameters)
        self._tip = self.chain.point_weights(2, parameters.link_lengths[1])
        self._sensor = self.chain.point_weights(2, settings.sensor_position)
        law = settings.law if settings.mode.law == "tip" else None
        self._law = None if law is None else TipLaw(self.chain, law, parameters.link_lengths)
        self._further = [
            (one.sensor.quantity, self.chain.point_weights(one.link, one.position)) for one in settings.further_sensors
        ]

    def _angles(self, half: Array) -> Array:
        """Return the angles of the chain's joints from public coordinates, or rates from rates. Shape (2 segments,)."""
        joints, modal = half[:2], half[2:].reshape(2, -1)
        bends = [lift @ q for lift, q in zip(self._gauges.bends, modal, strict=True)]
        return np.concatenate([joints[:1], bends[0], joints[1:] - self._gauges.elbow @ bends[0], bends[1]])

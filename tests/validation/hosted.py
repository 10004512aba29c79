"""The environment of a policy around any arm, so that the package's own drivers make what the policy sees."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from flexarm_env.codegen.arrays import Four
from flexarm_env.envs.drawing import Drawing, drawing_of
from flexarm_env.envs.hosted import HostedSimulator
from flexarm_env.envs.settings import Settings
from flexarm_env.envs.single import FlexArmEnv
from flexarm_env.physics.coordinates import rigid_tip
from flexarm_env.physics.sensing import Truth
from tests.validation.arms import Gauges, Plant
from tests.validation.motion import HELD, Array


class AnyArm:
    """An arm of the studies as that of an environment (`flexarm_env.envs.hosted.Plant`); it keeps where the tip was.

    Encoders and the late sensor read the arm itself, strain gauges that part of its bending which the environment's own
    shapes can express (`flexarm_env.chain.gauges`). `torque` [N m] acted last.
    """

    def __init__(self, arm: Plant, settings: Settings) -> None:
        """Take an arm that is where the episode begins."""
        own = settings.flexible_arm
        end = settings.sensor, settings.sensor_position
        assert end == ("true", own.parameters.link_lengths[1]), "the sensor must read the end of link 2"
        self._periods = round(settings.control_period / settings.substeps / HELD)
        whole = np.isclose(self._periods * HELD * settings.substeps, settings.control_period)
        assert whole, f"the physics step must be a multiple of {HELD} s"
        self._arm, self._settings, self._gauges = arm, settings, Gauges(own)
        self._tips: list[Array] = []
        self.torque = np.zeros(2)

    def taken(self) -> Array:
        """Return where the tip was every `HELD` since the last call. Shape (n, 2)."""
        tips, self._tips = self._tips, []
        return np.concatenate(tips)

    def begin(self, state: Array, quantities: Mapping[str, float]) -> None:
        assert np.allclose(self._arm.look().joints, state[:2], atol=1e-9), "the arm must be where the episode begins"

    def advance(self, command: Array, reference: Four | None) -> Array:
        self.torque = np.array(command)
        self._tips.append(self._arm.advance(command, self._periods))
        return command

    def readings(self) -> Array:
        return self._arm.end()

    def encoders(self) -> Array:
        sight = self._arm.look()
        return np.concatenate([sight.joints, sight.rates])

    def truth(self) -> Truth:
        sight, state = self._arm.look(), self._gauges.state(self._arm.bend())
        own = self._settings.flexible_arm
        rigid = rigid_tip(own.parameters.link_lengths, sight.joints)
        deflections = (own.tip_deflection(half).tolist() for half in np.split(state, 2))
        return Truth(state.tolist(), sight.tip.tolist(), rigid.tolist(), *deflections)

    def drawing(self) -> Drawing:
        return drawing_of(self._settings, self._gauges.state(self._arm.bend()))


class HostedEnv(FlexArmEnv):
    """An environment around an arm of the studies; it ends no episode early."""

    host: AnyArm  # the arm

    def __init__(self, arm: Plant, **options: Any) -> None:
        """Lay it out around an arm where the episode begins."""
        self._given = arm
        super().__init__(**(options | {"deflection_limit": None, "error_limit": None}))

    def _simulator_of(self, settings: Settings) -> HostedSimulator:
        self.host = AnyArm(self._given, settings)
        return HostedSimulator(settings, self.host)

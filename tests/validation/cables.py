"""The arm as two cables of the absolute nodal coordinate formulation (ANCF) in Exudyn, a second independent engine.

A cable's nodes have position and slope vector, and its line is cubic between them (Gerstmayr and Irschik 2008: strain
energy of bending by the true curvature, of stretching by the true axial strain). So rotations and deflections of any
size are exact, and no mode, segment or hinge spring is assumed: nothing is in common with the package, or with the
chain of rigid segments in MuJoCo, but the arm's parameters. The cable stretches a little, `AXIAL_STIFFNESS`.

Motors turn the end tangents of the cables. Generalised-alpha integrates, implicitly, so that stiff stretching does not
matter; nothing is damped but what is faster than the steps (`SPECTRAL_RADIUS`).
"""

import warnings
from collections.abc import Callable
from typing import Any

import exudyn as exu
import numpy as np
from exudyn import itemInterface

from flexarm_env import ArmParameters
from tests.validation.motion import HELD, Array, Motion, Programme

AXIAL_STIFFNESS = 1e7  # EA [N]; 100 N of inertia forces stretch 4.5 m by 0.05 mm
SPECTRAL_RADIUS = 0.95  # of generalised-alpha: 1 damps nothing, 0 all that is fast
RESIDUAL = 1e-4  # [N], of Newton's method
ELEMENTS, STEP = 12, 2.5e-4  # of a cable; [s]


class _Cable:
    """One link; `start`: reference coordinates of its nodes, place [m] and slope. Shape (elements + 1, 4)."""

    def __init__(
        self, system: Any, arm: ArmParameters, link: int, pose: tuple[Array, float], n: int, axial_stiffness: float
    ) -> None:
        """Lay link 0 or 1 out at rest, straight, of n elements; pose: x, y of its root [m], its angle [rad]."""
        root, angle = pose
        direction = np.array([np.cos(angle), np.sin(angle)])
        places = root + np.outer(np.linspace(0.0, arm.link_lengths[link], n + 1), direction)
        self.start = np.hstack([places, np.tile(direction, (n + 1, 1))])
        nodes = [itemInterface.NodePoint2DSlope1(referenceCoordinates=at.tolist()) for at in self.start]
        self.nodes = [system.AddNode(node) for node in nodes]
        self.length = arm.link_lengths[link] / n
        cable = {
            "length": self.length,
            "massPerLength": arm.masses_per_length[link],
            "bendingStiffness": arm.flexural_rigidities[link],
            "axialStiffness": axial_stiffness,
            "useReducedOrderIntegration": 1,  # bending and stretching would otherwise lock each other
        }
        pairs = zip(self.nodes[:-1], self.nodes[1:], strict=True)
        items = [itemInterface.ObjectANCFCable2D(nodeNumbers=list(pair), **cable) for pair in pairs]
        self.elements = [system.AddObject(item) for item in items]

    def place(self, system: Any, end: int) -> Any:
        """Return a marker of the root (0) or the tip (-1)."""
        return system.AddMarker(itemInterface.MarkerNodePosition(nodeNumber=self.nodes[end]))

    def tangent(self, system: Any, end: int) -> Any:
        """Return a marker that turns with the root's (0) or the tip's (-1) tangent."""
        at = [0.0 if end == 0 else self.length, 0.0, 0.0]
        return system.AddMarker(itemInterface.MarkerBodyRigid(bodyNumber=self.elements[end], localPosition=at))


def cable_motion(
    programme: Programme, elements: int = ELEMENTS, step: float = STEP, axial_stiffness: float = AXIAL_STIFFNESS
) -> Motion:
    """Run a programme on the cables, undamped, with so many elements a cable; `step` [s] divides `HELD`."""
    arm, torques = programme.parameters(), programme.torques()
    hubs = (arm.shoulder_hub_inertia, arm.elbow_hub_inertia, arm.elbow_mass)
    if np.any(programme.pull) or programme.spin or any(hubs):
        raise ValueError(f"programme = {programme.name!r}: must begin straight and at rest, on an arm without hubs")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # names that Exudyn 1.13 writes anew
        container = exu.SystemContainer()
        system = container.AddSystem()
        cables = _arm(system, arm, programme, elements, axial_stiffness)
        for marker, joint, sign in (
            (cables[0].tangent(system, 0), 0, 1.0),
            (cables[0].tangent(system, -1), 1, -1.0),
            (cables[1].tangent(system, 0), 1, 1.0),
        ):
            load = _held(sign * torques[:, joint])
            system.AddLoad(itemInterface.LoadTorqueVector(markerNumber=marker, loadVectorUserFunction=load))
        kind = {"storeInternal": True, "outputVariableType": exu.OutputVariableType.Coordinates}
        sensors = [[itemInterface.SensorNode(nodeNumber=node, **kind) for node in cable.nodes] for cable in cables]
        sensors = [[system.AddSensor(each) for each in row] for row in sensors]
        system.Assemble()
        system.SolveDynamic(_settings(len(torques) * HELD, step))
        moved = [np.array([system.GetSensorStoredData(each)[:, 1:5] for each in row]) for row in sensors]
    return _motion([each + cable.start[:, None] for each, cable in zip(moved, cables, strict=True)], arm)


def _arm(
    system: Any, arm: ArmParameters, programme: Programme, elements: int, axial_stiffness: float
) -> tuple[_Cable, _Cable]:
    """Join two cables, the payload, and the ground."""
    theta1, theta2 = programme.joints
    first = _Cable(system, arm, 0, (np.zeros(2), theta1), elements, axial_stiffness)
    second = _Cable(system, arm, 1, (first.start[-1, :2], theta1 + theta2), elements, axial_stiffness)
    earth = system.AddObject(itemInterface.ObjectGround())
    ground = system.AddMarker(itemInterface.MarkerBodyPosition(bodyNumber=earth))
    pairs = [(ground, first.place(system, 0)), (first.place(system, -1), second.place(system, 0))]
    if arm.payload_mass > 0.0:
        tip = second.start[-1, :2]
        node = system.AddNode(itemInterface.NodePoint2D(referenceCoordinates=tip.tolist()))
        system.AddObject(itemInterface.ObjectMassPoint2D(physicsMass=arm.payload_mass, nodeNumber=node))
        payload = system.AddMarker(itemInterface.MarkerNodePosition(nodeNumber=node))
        pairs.append((second.place(system, -1), payload))
    for pair in pairs:
        system.AddObject(itemInterface.ObjectJointRevolute2D(markerNumbers=list(pair)))
    return first, second


def _held(torques: Array) -> Callable[[Any, float, Any], list[float]]:
    """Return a load's function of time: each torque is held for `HELD`; where one follows another, their mean.

    The integrator takes the mean of a step's ends, so that a torque which changes acts on time, to second order.
    """
    after = torques.tolist()
    before = [after[0], *after[:-1]]

    def load(system: Any, time: float, given: Any) -> list[float]:
        place = time / HELD
        k = min(int(place + 1e-6), len(after) - 1)
        return [0.0, 0.0, 0.5 * (before[k] + after[k]) if abs(place - k) < 1e-6 else after[k]]

    return load


def _settings(duration: float, step: float) -> Any:
    settings = exu.SimulationSettings()
    integration = settings.timeIntegration
    integration.endTime, integration.numberOfSteps = duration, round(duration / step)
    integration.verboseMode = 0
    integration.generalizedAlpha.spectralRadius = SPECTRAL_RADIUS
    integration.newton.useModifiedNewton = True
    integration.newton.absoluteTolerance = RESIDUAL
    settings.solutionSettings.sensorsWritePeriod = HELD
    settings.solutionSettings.writeSolutionToFile = False
    return settings


def _motion(coordinates: list[Array], arm: ArmParameters) -> Motion:
    """Read a motion off the nodes' places and slopes; their shape is (nodes, instants, 4) for each link."""
    angles = [np.unwrap(np.arctan2(each[..., 3], each[..., 2]), axis=1) for each in coordinates]
    joints = np.column_stack([angles[0][0], angles[1][0] - angles[0][-1]])
    bends = [each - each[0] for each in angles]
    pairs = zip(bends, arm.link_lengths, strict=True)
    deflection = [np.trapezoid(each, dx=length / (len(each) - 1), axis=0) for each, length in pairs]
    return Motion(coordinates[1][-1, :, :2], joints, np.column_stack(deflection))

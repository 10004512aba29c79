"""The recorded kernels of the arm (`recorder`)."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any

from flexarm_env.codegen.arrays import Arena, LaneRows
from flexarm_env.codegen.elementary import sincos
from flexarm_env.codegen.tracing import clip, where_less
from flexarm_env.control import joint_tracking
from flexarm_env.kernels.recorder import Recorder, recorded_by, recorded_kernel, sine_of_theta2
from flexarm_env.kernels.tableau import RK4_NODES, RK4_WEIGHTS
from flexarm_env.physics import dynamics as dyn
from flexarm_env.physics import motors, sensing
from flexarm_env.physics.constants import Constants
from flexarm_env.physics.linear_algebra import plus_scaled
from flexarm_env.physics.modal_elimination import elimination


def enter_slopes(r: Recorder, y: Sequence[Any], p: Sequence[Any]) -> None:
    """Write the slopes of a state."""
    slopes = slopes_at(r, y, p)
    r.write("V", slopes[: len(y)])
    r.write("FORCE", slopes[len(y) :])


def slopes_at(r: Recorder, y: Sequence[Any], p: Sequence[Any]) -> list[Any]:
    """Return v, and p' without the motors' part, by the formula that all kernels of a module share."""
    known = [*r.read("CONSTANTS"), *r.read("ELIMINATION")]
    return r.trace.call("slope", [*known, *y, *p, *sincos(dyn.elbow_turn(y))], 2 * len(y))


@recorded_kernel
def slope_kernel(r: Recorder, arena: Arena) -> None:
    """Compute V and FORCE of every lane from Y and P."""
    enter_slopes(r, r.read("Y"), r.read("P"))


@recorded_kernel
def momentum_kernel(r: Recorder, arena: Arena) -> None:
    """Compute P and FORCE from Y and V, before the first step of a motion; of environments, where STARTS is 1."""
    k, y, v = r.constants(), r.read("Y"), r.read("V")
    sin, cos = sincos(dyn.elbow_turn(y))
    angles = cos, sin, sine_of_theta2(r.variant, k, y)
    for name, values in (
        ("P", dyn.momentum(k, y, v, cos, sin)),
        ("FORCE", dyn.momentum_rate(k, r.variant.complete, y, v, (0.0, 0.0), angles)),
    ):
        if r.variant.episodes:
            pairs = zip(values, r.read(name), strict=True)
            values = [where_less(0.5, r.one("STARTS"), new, old) for new, old in pairs]
        r.write(name, values)


def _pushed(r: Recorder, k: Constants, y: Sequence[Any], force: Sequence[Any]) -> Sequence[Any]:
    """Add the force at the tip, if there is one, to generalised forces."""
    if not r.variant.pulses:
        return force
    axes = (*sincos(y[0]), *sincos(y[len(y) // 2]))
    own = dyn.point_force(k, r.place("TIP"), y, r.read("TIP_FORCE"), axes)
    return [a + b for a, b in zip(force, own, strict=True)]


def driven(k: Constants, force: Sequence[Any], tau: Sequence[Any]) -> list[Any]:
    """Return p', from that without the motors' part."""
    return [a + b for a, b in zip(force, dyn.generalised_torque(k, tau), strict=True)]


def move(r: Recorder, h: Any, total: Sequence[Any]) -> None:
    """Write the end of a step of h [s], from the weighted sum of its rates."""
    y, p = r.read("Y"), r.read("P")
    moved = plus_scaled([*y, *p], h / 6.0, total)
    r.write("Y", moved[: len(y)])
    r.write("P", moved[len(y) :])
    enter_slopes(r, moved[: len(y)], moved[len(y) :])


def _lagged(r: Recorder, place: int, wanted: Sequence[Any]) -> list[Any]:
    """Return the current loops' torques at a place of `motors.response`."""
    left = r.read("MOTOR_RESPONSE")[2 * place : 2 * place + 2]
    return [u + share * (m - u) for u, share, m in zip(wanted, left, r.read("MOTOR"), strict=True)]


def _motor_torque(r: Recorder, k: Constants, place: int, wanted: Sequence[Any], v: Sequence[Any]) -> list[Any]:
    limits = r.read("STALL_TORQUE"), r.read("PER_SPEED")
    return motors.available(_lagged(r, place, wanted), dyn.joint_angles(k, v), *limits)


def _tracking_torque(r: Recorder, k: Constants, basis_of: int, state: tuple[Sequence[Any], Sequence[Any]]) -> list[Any]:
    basis = [r.trace.number("bases", basis_of, n) for n in range(8)]
    aim = joint_tracking.interpolated(r.read("INNER_FROM"), r.read("INNER_TO"), basis)
    gains = (r.read("STIFFNESS"), r.read("RESISTANCE"))
    tau = joint_tracking.tracking_torque(k, gains, aim, r.read("TAU"), state)
    return [clip(value, -limit, limit) for value, limit in zip(tau, r.read("TORQUE_LIMIT"), strict=True)]


@recorded_kernel
def step_kernel(r: Recorder, arena: Arena, h: float, bases: tuple[Sequence[float], ...] = ()) -> None:
    """Advance the torque-driven arm of every lane by one step with held torques: Y, P, V and FORCE.

    The classical Runge-Kutta method; with the joint-space law for the kind "tracking".

    It integrates positions and momenta, not rates: an error of the fast modes then does not move the slow motion
    through M(y)^-1 (docs/model.md). All stages are in one pass over the lanes, so that slopes and their sum stay in
    registers. The slopes at the step's end are the first of the next one. A doubled slope is written as a sum, since
    the processor's adders are idle while its multipliers work.

    Args:
        r: records it.
        arena: arena of one block; V, P and FORCE belong together (`momentum_kernel`).
        h: step [s].
        bases: see `actuation.spline_factors`, at the step's start, middle and end; under the joint-space law only.
    """
    y, p, k = r.read("Y"), r.read("P"), r.constants()
    stage_y, slopes = y, [*r.read("V"), *r.read("FORCE")]
    total: list[Any] = []
    acted = [0.0, 0.0]
    for node, next_node, weight in zip(RK4_NODES, (*RK4_NODES[1:], None), RK4_WEIGHTS, strict=True):
        assert weight in (1.0, 2.0)
        v, acting = slopes[: len(y)], r.read("TAU")
        if r.variant.tracking:
            acting = _tracking_torque(r, k, round(2 * node), (stage_y, v))
            if not total:
                r.write("STAGE_TORQUE", acting)
            if next_node is None and r.variant.further_readings:
                r.write("END_TORQUE", acting)
        if r.variant.motors:
            acting = _motor_torque(r, k, round(2 * node), acting, v)
            acted = plus_scaled(acted, weight / 6.0, acting)
        rates = [*v, *driven(k, _pushed(r, k, stage_y, slopes[len(y) :]), acting)]
        each = rates if weight == 1.0 else [a + a for a in rates]
        total = [a + b for a, b in zip(total, each, strict=True)] if total else each
        if next_node is not None:
            ahead = h * next_node
            stage_y, stage_p = plus_scaled(y, ahead, v), plus_scaled(p, ahead, rates[len(y) :])
            slopes = slopes_at(r, stage_y, stage_p)
    move(r, h, total)
    if r.variant.motors:
        r.write("ACTED", acted)
        r.write("MOTOR", _lagged(r, 3, r.read("TAU")))


@recorded_by(partial(Recorder, fusing=False))
def elimination_kernel(r: Recorder, arena: Arena) -> None:
    """Compute the elimination's numbers of every lane's arm, with linear kinematics.

    Rounded as Python rounds it for the kernels whose arms never change (`layout.arm_rows`).
    """
    e = elimination(r.constants())
    if e is None:
        raise LookupError("a foreshortened arm has no elimination")
    r.write("ELIMINATION", e.flat())


@recorded_kernel
def reading_kernel(r: Recorder, arena: Arena, readings: LaneRows) -> None:
    """Measure without delay, on every lane: two readings, two rates. Shape (4, lanes)."""
    place = r.place("SENSOR_POINT")
    r.store("readings", sensing.reading(r.constants(), place, r.variant.sensor, r.read("Y"), r.read("V")))


@recorded_kernel
def further_reading_kernel(r: Recorder, arena: Arena, readings: LaneRows) -> None:
    """Compute the further sensors' present readings, and the rates of positions (`entries.ReadingRow`).

    The acceleration follows from the equations of motion under the torques that act at the end of the latest step.
    """
    k, y, v = r.constants(), r.read("Y"), r.read("V")
    quantities = [sensing.QUANTITIES_AT_A_POINT[name] for name, _ in r.variant.sensors]
    acceleration: Sequence[Any] = ()
    if any(quantity.accelerated for quantity in quantities):
        sin, cos = sincos(dyn.elbow_turn(y))
        angles = cos, sin, sine_of_theta2(r.variant, k, y)
        torque = r.read("END_TORQUE" if r.variant.tracking else "TAU")
        if r.variant.motors:
            limits = r.read("STALL_TORQUE"), r.read("PER_SPEED")
            torque = motors.available(r.read("MOTOR"), dyn.joint_angles(k, v), *limits)
        acceleration = dyn.acceleration(k, r.elimination(), r.variant.complete, y, v, torque, angles)
        if r.variant.pulses:
            inertia = dyn.inertia(k, r.elimination(), y, cos, sin)
            own = dyn.solve(k, r.elimination(), inertia, _pushed(r, k, y, [0.0] * len(y)))
            acceleration = [a + b for a, b in zip(acceleration, own, strict=True)]
    motion = sensing.Motion(y, v, acceleration)
    each = [quantity.formula(k, r.mount(n), motion) for n, quantity in enumerate(quantities)]
    r.store("readings", [number for reading in each for number in reading])


@recorded_kernel
def truth_kernel(r: Recorder, arena: Arena) -> None:
    """Compute state, tips and deflections of each lane."""
    truth = sensing.truth(r.constants(), r.place("TIP"), r.read("Y"), r.read("V"))
    for name, values in truth._asdict().items():
        r.write(name.upper(), values)

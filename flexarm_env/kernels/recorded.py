"""The recorded kernels of the arm and of the paper's law (`recorder`)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from flexarm_env.codegen.arrays import Arena, Four, LaneRows
from flexarm_env.codegen.elementary import sincos
from flexarm_env.codegen.tracing import clip
from flexarm_env.control import jacobian_transpose, joint_tracking
from flexarm_env.kernels.recorder import Recorder, recorded_kernel
from flexarm_env.kernels.tableau import GAMMA, RK4_NODES, RK4_WEIGHTS, STAGES
from flexarm_env.kernels.variants import Variant
from flexarm_env.physics import dynamics as dyn
from flexarm_env.physics import sensing
from flexarm_env.physics.constants import Constants
from flexarm_env.physics.linear_algebra import plus_scaled
from flexarm_env.physics.modal_elimination import elimination


def slope_kernel_record(variant: Variant) -> Recorder:
    """Record the acceleration alone."""
    r = Recorder(variant)
    known, y, v = [*r.read("CONSTANTS"), *r.read("ELIMINATION")], r.read("Y"), r.read("V")
    turn = sincos(dyn.elbow_turn(y))
    r.store("rates", r.trace.call("slope", [*known, *y, *v, *r.read("TAU"), *turn], len(v)))
    return r


@recorded_kernel(slope_kernel_record)
def slope_kernel(arena: Arena, rates: LaneRows) -> None:
    """Acceleration of the torque-driven arm of every lane.

    Args:
        arena: arena of one block.
        rates: receives v'. Shape (size, lanes).
    """


def step_record(variant: Variant) -> Recorder:
    """Record one step of the classical Runge-Kutta method; with the joint-space law for the kind "tracking".

    All four stages in one pass over the lanes, so that slopes and their sum stay in registers. A stage's positions need
    the velocities of the stage before, but not its slope, so its sine is at hand early: the two are worked out side by
    side. (After the last stage comes none: what is written for it no result needs, and `Trace.lines` leaves it out.)
    Twice a slope is a sum, since units that only add are idle while others multiply.
    """
    r = Recorder(variant)
    known, h, y, v = [*r.read("CONSTANTS"), *r.read("ELIMINATION")], r.trace.input("h"), r.read("Y"), r.read("V")
    stage_y, stage_v, turn = y, v, sincos(dyn.elbow_turn(y))
    total: list[Any] = []
    for node, next_node, weight in zip(RK4_NODES, (*RK4_NODES[1:], 0.0), RK4_WEIGHTS, strict=True):
        assert weight in (1.0, 2.0)
        ahead = h * next_node
        next_y = plus_scaled(y, ahead, stage_v)
        next_turn = sincos(dyn.elbow_turn(next_y))
        acting = r.read("TAU")
        if variant.tracking:
            acting = _tracking_torque(r, r.constants(), round(2 * node), (stage_y, stage_v))
            if not total:
                r.write("STAGE_TORQUE", acting)
        slope = r.trace.call("slope", [*known, *stage_y, *stage_v, *acting, *turn], len(v))
        each = [*stage_v, *slope] if weight == 1.0 else [a + a for a in (*stage_v, *slope)]
        total = [a + b for a, b in zip(total, each, strict=True)] if total else each
        stage_y, stage_v, turn = next_y, plus_scaled(v, ahead, slope), next_turn
    sixth = h / 6.0
    moved = plus_scaled([*y, *v], sixth, total)
    r.write("Y", moved[: len(y)])
    r.write("V", moved[len(y) :])
    return r


def _tracking_torque(r: Recorder, k: Constants, basis_of: int, state: tuple[Sequence[Any], Sequence[Any]]) -> list[Any]:
    basis = r.trace.inputs([f"bases[{basis_of}][{n}]" for n in range(8)])
    aim = joint_tracking.interpolated(r.read("INNER_FROM"), r.read("INNER_TO"), basis)
    gains = (r.read("STIFFNESS"), r.read("RESISTANCE"))
    tau = joint_tracking.tracking_torque(k, gains, aim, r.read("TAU"), state)
    return [clip(value, -limit, limit) for value, limit in zip(tau, r.read("TORQUE_LIMIT"), strict=True)]


@recorded_kernel(step_record)
def step_kernel(arena: Arena, h: float, bases: tuple[Sequence[float], ...] = ()) -> None:
    """Advance the torque-driven arm of every lane by one step with held torques.

    Args:
        arena: arena of one block.
        h: step [s].
        bases: see `actuation.spline_factors`, at the step's start, middle and end; under the joint-space law only.
    """


def law_record(variant: Variant) -> Recorder:
    """Record one stage of the closed loop."""
    r = Recorder(variant)
    h, ahead = r.trace.input("h"), r.trace.input("ahead")
    y, v_known = r.read("Y"), r.read("V")
    size = len(y)
    slots = [r.read(name) for name in ("V_SLOTS", "MECHANICAL_SLOTS", "FEEDBACK_SLOTS")]
    for slot in range(STAGES):
        explicit, implicit = (h * r.trace.input(f"{name}[{slot}]") for name in ("explicit", "implicit"))
        v, mechanical, feedback = (values[slot * size : (slot + 1) * size] for values in slots)
        y = [a + explicit * b for a, b in zip(y, v, strict=True)]
        v_known = [a + (explicit * b + implicit * c) for a, b, c in zip(v_known, mechanical, feedback, strict=True)]
    law = r.law()
    here = [[x + vx * ahead, y + vy * ahead, vx, vy] for x, y, vx, vy in (law.command_1, law.command_2)]
    law = law._replace(command_1=here[0], command_2=here[1])
    options = (variant.complete, variant.sensor if variant.law_on_sensor else "rigid", variant.rate_jacobian)
    stage = jacobian_transpose.law_stage(r.constants(), r.elimination(), law, options, y, v_known, h * GAMMA)
    r.write("Y_STAGE", y)
    r.write("V_STAGE", stage.v)
    r.write("MECHANICAL", stage.mechanical)
    r.write("FEEDBACK", stage.feedback)
    r.write("TAU", stage.tau)
    return r


@recorded_kernel(law_record)
def law_kernel(arena: Arena, h: float, ahead: float, explicit: Four, implicit: Four) -> None:
    """Compute one stage of the closed loop of every lane: earlier stages, then `jacobian_transpose.law_stage`.

    Args:
        arena: arena of one block; results in Y_STAGE, V_STAGE, MECHANICAL, FEEDBACK, TAU.
        h: step [s].
        ahead: time of the stage after the step's start [s].
        explicit: coefficients of the stages before, explicit part.
        implicit: the same, implicit part.
    """


def elimination_record(variant: Variant) -> Recorder:
    """Record the elimination's numbers, from the constants of an arm.

    Rounded as Python rounds it for the kernels whose arms never change (`layout.arm_rows`).
    """
    r = Recorder(variant, fusing=False)
    e = elimination(r.constants())
    assert e is not None
    r.write("ELIMINATION", e.flat())
    return r


@recorded_kernel(elimination_record)
def elimination_kernel(arena: Arena) -> None:
    """Compute the elimination's numbers of every lane's arm, with linear kinematics."""


def reading_record(variant: Variant) -> Recorder:
    """Record what the sensor measures now."""
    r = Recorder(variant)
    place = r.place("SENSOR_POINT")
    r.store("readings", sensing.reading(r.constants(), place, variant.sensor, r.read("Y"), r.read("V")))
    return r


@recorded_kernel(reading_record)
def reading_kernel(arena: Arena, readings: LaneRows) -> None:
    """Measure without delay, on every lane: two readings, two rates. Shape (4, lanes)."""


def second_reading_record(variant: Variant) -> Recorder:
    """Record the kernel of the second sensor's present reading."""
    r = Recorder(variant)
    place, link = r.place("SECOND"), variant.second_sensor
    r.store("readings", sensing.point_reading(r.constants(), place, r.read("Y"), r.read("V"), link))
    return r


@recorded_kernel(second_reading_record)
def second_reading_kernel(arena: Arena, readings: LaneRows) -> None:
    """Compute the second sensor's present reading, as `reading_kernel` does for the first. Shape (4, lanes)."""


def truth_record(variant: Variant) -> Recorder:
    """Record the kernel of state, tips and deflections."""
    r = Recorder(variant)
    truth = sensing.truth(r.constants(), r.place("TIP"), r.read("Y"), r.read("V"))
    for name, values in truth._asdict().items():
        r.write(name.upper(), values)
    return r


@recorded_kernel(truth_record)
def truth_kernel(arena: Arena) -> None:
    """Compute state, tips and deflections of each lane."""

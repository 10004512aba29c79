"""Recorded kernels of an environment: parts of observations, terms of the reward."""

from __future__ import annotations

from flexarm_env.codegen.arrays import Arena, Table
from flexarm_env.codegen.tracing import root
from flexarm_env.episode import features, reward
from flexarm_env.kernels.recorder import Recorder, recorded_kernel
from flexarm_env.kernels.variants import Variant


def features_record(variant: Variant) -> Recorder:
    """Record the kernel of the observations' parts and the reward's terms."""
    r = Recorder(variant)
    names = ("encoders", "reference", "reference_joints", "link_sensor", "sensor_error", "sensor_error_rate")
    measured = features.Measurements(
        **{name: r.read(name.upper()) for name in names},
        lengths=(r.trace.number("length_1"), r.trace.number("length_2")),
        phase=r.one("PHASE"),
        frame=r.one("LINK_FRAME"),
    )
    found = features.features(measured)
    for name, values in found._asdict().items():
        r.write(("" if name == "frame_axis" else "F_") + name.upper(), values)
    errors, error_rates = features.joint_errors(r.read("PRESENT_JOINT"), measured.encoders)
    r.write("F_PRESENT_JOINT_ERROR", errors)
    r.write("F_PRESENT_JOINT_ERROR_RATE", error_rates)
    for name in ("FURTHER_READING", "FURTHER_ERROR") if variant.further_points else ():
        points = [r.read(name)[2 * n : 2 * n + 2] for n in range(variant.further_points)]
        r.write(f"F_{name}", [x for point in points for x in features.in_frame(found.frame_axis, point)])
    square = reward.squared_distance(r.read("TRUE_TIP"), r.read("REFERENCE"))
    r.write("TIP_ERROR", [root(square)])
    terms = reward.tracking_terms(square)
    terms += reward.regularising_terms(r.one("ACTION_CHANGE"), r.read("TORQUE"), r.read("DEFLECTION_RATE"))
    if variant.racing:
        terms.append(reward.progress_term(r.one("REFERENCE_SPEED"), r.read("PACE")[0]))
    weighted = [weight * term for weight, term in zip(r.elements("weights", len(terms)), terms, strict=True)]
    r.write("REWARD_TERMS", weighted)
    total = weighted[0]
    for term in weighted[1:]:
        total = total + term
    r.write("REWARD", [total])
    return r


@recorded_kernel(features_record)
def features_kernel(arena: Arena, length_1: float, length_2: float, weights: Table) -> None:
    """Compute each lane's parts of observations and terms of the reward.

    Args:
        arena: of one block.
        length_1: length of link 1 [m].
        length_2: length of link 2 [m].
        weights: weight of each term.
    """


def joint_record(variant: Variant) -> Recorder:
    """Record the kernel of the joint angles and rates of the rigid arm whose tip is on the reference."""
    r = Recorder(variant)
    lengths = (r.trace.number("length_1"), r.trace.number("length_2"))
    r.write(
        "REFERENCE_JOINTS",
        features.joint_aim(lengths, r.one("BRANCH"), r.read("REFERENCE"), r.read("REFERENCE_JOINTS")[0]),
    )
    return r


@recorded_kernel(joint_record)
def joint_kernel(arena: Arena, length_1: float, length_2: float) -> None:
    """Compute each lane's joint angles and rates of the rigid arm on the reference."""

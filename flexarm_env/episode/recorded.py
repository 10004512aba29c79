"""Records what is reported of an environment: state and tips, parts of observations, terms of the reward."""

from __future__ import annotations

from flexarm_env.codegen.arrays import Arena, Table
from flexarm_env.codegen.declarations import recorded
from flexarm_env.codegen.tracing import root
from flexarm_env.episode import features, reward
from flexarm_env.kernels.recorded import SHARED, Recorder
from flexarm_env.kernels.variants import Variant


def truth_source(variant: Variant) -> str:
    """State, tips and deflections of an environment's arm."""
    r = Recorder(variant)
    truth = r.truth()
    for name, values in truth._asdict().items():
        r.write(name.upper(), values)
    return r.source("truth_kernel(arena)")


@recorded(truth_source, SHARED)
def truth_kernel(arena: Arena) -> None:
    """State, tips and deflections of every lane."""


def features_source(variant: Variant) -> str:
    """What observations are made of, and the reward's terms."""
    r = Recorder(variant)
    names = ("encoders", "reference", "reference_joints", "link_sensor", "sensor_error", "sensor_error_rate")
    known = features.Measurements(
        **{name: r.read(name.upper()) for name in names},
        lengths=(r.trace.input("length_1"), r.trace.input("length_2")),
        phase=r.one("PHASE"),
        frame=r.one("LINK_FRAME"),
    )
    for name, values in features.features(known)._asdict().items():
        r.write(("" if name == "frame_axis" else "F_") + name.upper(), values)
    square = reward.squared_distance(r.read("TRUE_TIP"), r.read("REFERENCE"))
    r.write("TIP_ERROR", [root(square)])
    terms = reward.tracking_terms(square)
    terms += reward.regularising_terms(r.one("ACTION_CHANGE"), r.read("TORQUE"), r.read("DEFLECTION_RATE"))
    weighted = [weight * term for weight, term in zip(r.elements("weights", len(terms)), terms, strict=True)]
    r.write("REWARD_TERMS", weighted)
    total = weighted[0]
    for term in weighted[1:]:
        total = total + term
    r.write("REWARD", [total])
    return r.source("features_kernel(arena, length_1, length_2, weights)")


@recorded(features_source, SHARED)
def features_kernel(arena: Arena, length_1: float, length_2: float, weights: Table) -> None:
    """Parts of observations and terms of the reward, of every lane; `weights`: of the terms."""


def joint_source(variant: Variant) -> str:
    """Joint angles and rates of the rigid arm whose tip is on the reference."""
    r = Recorder(variant)
    lengths = (r.trace.input("length_1"), r.trace.input("length_2"))
    r.write(
        "REFERENCE_JOINTS",
        features.joint_aim(lengths, r.trace.input("branch"), r.read("REFERENCE"), r.read("REFERENCE_JOINTS")[0]),
    )
    return r.source("joint_kernel(arena, length_1, length_2, branch)")


@recorded(joint_source, SHARED)
def joint_kernel(arena: Arena, length_1: float, length_2: float, branch: float) -> None:
    """Joint angles and rates of the rigid arm on the reference, of every lane."""

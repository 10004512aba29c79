"""The damping of the links: one ratio, two models, the same for arms of any shapes and for the chain."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings

from flexarm_env import ArmParameters, FlexibleArm
from flexarm_env.analysis import OperatingPoint, natural_modes
from flexarm_env.parameters import CLAMPED_ONE_PERCENT, DampingModel
from flexarm_env.physics.damping import clamped_ratio, unit_damping
from tests.support.lagrange import arms, loaded_arm
from tests.support.refusals import refuses

MODELS: tuple[DampingModel, ...] = ("modal", "material")


def first_elastic_ratio(arm: ArmParameters) -> float:
    """Ratio of the first elastic mode of the free straight arm, by `natural_modes`."""
    modes = natural_modes(OperatingPoint.at_angles(FlexibleArm(arm), (0.0, 0.0)))
    return float(modes.damping_ratios[2])


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("unequal", [False, True])
def test_the_ratio_is_that_of_the_free_arms_first_elastic_mode(model: DampingModel, unequal: bool) -> None:
    """Exactly with the definition's shapes; hubs, elbow and housing belong to it, payload and friction do not."""
    shapes = {"mode_shapes": "polynomial", "damping_model": model, "damping_ratio": 0.013}
    bare = {"payload_mass": 0.0, "payload_inertia": 0.0, "joint_friction": (0.0, 0.0)}
    housed = {"kinematics": "foreshortened", "elbow_housing_inertia": 0.6}
    arm = loaded_arm(4, **shapes, **bare, **housed) if unequal else ArmParameters(modes_per_link=4, **shapes)  # type: ignore[arg-type]
    assert first_elastic_ratio(arm) == pytest.approx(0.013, rel=1e-9)


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize(("modes", "shapes"), [(2, "cantilever"), (3, "polynomial"), (4, "cantilever")])
def test_other_shapes_have_nearly_the_same_ratio(model: DampingModel, modes: int, shapes: str) -> None:
    arm = ArmParameters(damping_ratio=0.01, damping_model=model, modes_per_link=modes, mode_shapes=shapes)  # type: ignore[arg-type]
    assert first_elastic_ratio(arm) == pytest.approx(0.01, rel=0.021)


def test_the_linear_arms_clamped_modes_are_damped_by_one_percent() -> None:
    linear = ArmParameters.linear()
    assert linear.damping_ratio == CLAMPED_ONE_PERCENT
    assert clamped_ratio(linear) == pytest.approx(0.01, rel=1e-12)


@settings(max_examples=30)
@given(arms())
def test_unit_damping_follows_its_scaling_laws(arm: ArmParameters) -> None:
    """A stiffness factor on both links scales the frequency by its root and leaves the shape alone."""
    one = unit_damping(arm)
    four = unit_damping(replace(arm, flexural_rigidities=tuple(4.0 * x for x in arm.flexural_rigidities)))
    assert four.frequency == pytest.approx(2.0 * one.frequency, rel=1e-9)
    assert four.clamped_ratio == pytest.approx(one.clamped_ratio, rel=1e-9)
    assert one.material_time * one.frequency == pytest.approx(2.0, rel=1e-12)


@pytest.mark.parametrize("change", [{"payload_mass": 3.0}, {"stiffness": 2.5}, {"damping": 0.05}])
@pytest.mark.parametrize("model", MODELS)
def test_a_drawn_arm_is_damped_as_one_made_so(model: DampingModel, change: dict[str, float]) -> None:
    """The constants that kernels work out for an episode are those of the arm with these parameters."""
    own = loaded_arm(2, damping_model=model)
    values = {"payload_mass": own.payload_mass, "stiffness": 1.0, "damping": own.damping_ratio} | change
    drawn = FlexibleArm(own).changes.constants(np.array([list(values.values())]))[0]
    payload, stiffness, damping = values.values()
    rigidities = tuple(stiffness * x for x in own.flexural_rigidities)
    made = replace(own, payload_mass=payload, damping_ratio=damping, flexural_rigidities=rigidities)
    np.testing.assert_allclose(drawn, FlexibleArm(made).constants.flat(), rtol=1e-10, atol=1e-14)


def test_a_step_too_long_for_the_drawn_damping_is_refused() -> None:
    """Overdamped modes are faster than undamped ones."""
    arm = FlexibleArm(ArmParameters(modes_per_link=3, damping_model="material", damping_ratio=0.01))
    state, torque = np.zeros(2 * arm.size), np.zeros(2)
    assert arm.longest_step() > 1e-3
    with refuses(ValueError, "step = 0.001", "too long"):
        arm.step(state, torque, damping=1.0)

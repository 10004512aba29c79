"""The steps into which a chain's time is divided."""

import pytest

pytest.importorskip("mujoco")

from flexarm_env import ArmParameters
from flexarm_env.chain.model import chain_model, growth, stable_steps

GROWING = 1.0 + 1e-6  # a rigid motion's double eigenvalue is known to half of the digits


@pytest.mark.parametrize("damping", [0.0, 0.005, 0.01])
@pytest.mark.parametrize("segments", [5, 20])
def test_they_are_the_fewest_that_are_stable_with_a_tenth_to_spare(segments: int, damping: float) -> None:
    model = chain_model(segments, ArmParameters(damping_ratio=damping))
    time, longest = 4e-3, 1e-3
    count = stable_steps(model, time, longest)
    assert growth(model, 1.1 * time / count) <= GROWING
    assert count == 4 or growth(model, 1.1 * time / (count - 1)) > GROWING


def test_too_many_are_refused() -> None:
    model = chain_model(60, ArmParameters(damping_ratio=0.0))
    with pytest.raises(ValueError, match="take more than 1000 steps in"):
        stable_steps(model, 0.1, 1e-2)

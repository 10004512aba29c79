"""Encoders that count."""

import numpy as np
import pytest

from tests.support.plain import PlainEnvironment


@pytest.mark.parametrize("noise", [0.0, 1e-4])
def test_encoders_count_angles_and_rates_follow_from_counts(noise: float) -> None:
    """An angle is off by half a count at most, a rate by one count a period, and on average by much less."""
    counts, period = np.array([1e-3, 2e-3]), 0.01
    env = PlainEnvironment(
        arm={"modes_per_link": 1},
        encoder_resolution=tuple(counts),
        encoder_noise=(noise, 0.0),
        observation=("joint_angles", "joint_rates"),
        scaled=False,
        start="corner",
    )
    rng, off = np.random.default_rng(0), []
    np.testing.assert_array_equal(env.block("joint_rates"), 0.0)
    for _ in range(60):
        env.step(rng.uniform(-1.0, 1.0, 2))
        angles, rates = env.block("joint_angles").astype(float), env.block("joint_rates").astype(float)
        state = env.result("STATE")
        steps = np.concatenate([angles / counts, rates * period / counts])
        np.testing.assert_allclose(steps, np.round(steps), atol=1e-2)  # float32 of some thousand counts
        assert np.all(np.abs(angles - state[:2]) <= 0.5 * counts + 6.0 * noise + 1e-6)
        off.append((rates - state[4:6]) * period / counts)
    assert np.abs(off).max() <= 1.0 + 1e-3
    assert np.all(np.abs(np.mean(off, axis=0)) < 0.2)  # deviates of a spread of 0.41: 4 of their mean's
    assert np.all(np.std(off, axis=0) > 0.2)

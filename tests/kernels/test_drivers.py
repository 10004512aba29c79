"""Drivers in plain Python against what is compiled, all of them together."""

from typing import Any

import gymnasium as gym
import numpy as np
import pytest

from flexarm_env.envs.batch import BatchSimulator
from flexarm_env.envs.settings import Settings
from tests.support.envs import PAPER, RESIDUAL, SQUARE
from tests.support.plain import run_plainly

SHIFTED = {"arm": "linear", "action_mode": "reference", "shift_limit": (0.2, 0.1)}


@pytest.mark.compiled
@pytest.mark.parametrize(
    ("env_id", "count", "options"),
    [
        (SQUARE, 8, {}),
        (RESIDUAL, 1, SHIFTED | {"reference": ["square", "line", "circle"]}),
        (PAPER, 1, {"compensation": "per_joint"}),
        (PAPER, 1, {"delay": 1e-4, "delayed": "position+rate"}),  # shorter than a step
    ],
    ids=str,
)
def test_environments_run_in_plain_python_as_compiled(
    env_id: str, count: int, options: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Episodes begin, and some periods pass; recorded kernels round their sums with products twice here."""
    settings = Settings.of({**gym.spec(env_id).kwargs, **options})
    compiled, plain = BatchSimulator(settings, count), BatchSimulator(settings, count)
    keys, everyone = np.arange(count, dtype=np.uint64) + 5, np.arange(count)
    compiled.start(keys, everyone, compiled.usual_requests)
    run_plainly(monkeypatch)
    plain.start(keys, everyone, plain.usual_requests)
    rng = np.random.default_rng(0)
    for k in range(4):
        np.testing.assert_allclose(plain.results, compiled.results, rtol=1e-8, atol=1e-9, err_msg=f"period {k}")
        np.testing.assert_allclose(plain.observations, compiled.observations, rtol=1e-5, atol=1e-6)
        compiled.actions[:] = plain.actions[:] = rng.uniform(-0.5, 0.5, plain.actions.shape)
        compiled.step()
        with np.errstate(all="ignore"):  # lanes without a reading divide by zero, as compiled
            plain.step()

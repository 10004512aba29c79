"""Drivers in plain Python against what is compiled, all of them together."""

from typing import Any

import gymnasium as gym
import numpy as np
import pytest

from flexarm_env.envs.batch import BatchSimulator
from flexarm_env.envs.settings import Settings
from tests.support import plain as plain_python
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


def played(settings: Settings) -> list[np.ndarray]:
    """Return observations and results of an episode's beginning in plain Python."""
    simulator = BatchSimulator(settings, 1)
    simulator.start(np.arange(1, dtype=np.uint64) + 5, np.arange(1), simulator.usual_requests)
    rng, found = np.random.default_rng(0), []
    for _ in range(3):
        simulator.actions[:] = rng.uniform(-0.5, 0.5, simulator.actions.shape)
        with np.errstate(all="ignore"):
            simulator.step()
        found += [simulator.observations.copy(), simulator.results.copy()]
    return found


@pytest.mark.compiled
@pytest.mark.parametrize("env_id", [SQUARE, RESIDUAL, PAPER])
def test_what_makes_plain_python_quick_changes_no_bit(env_id: str) -> None:
    settings, found = Settings.of(dict(gym.spec(env_id).kwargs)), []
    for quick in (True, False):
        with pytest.MonkeyPatch.context() as patch:
            if not quick:
                patch.setattr(plain_python, "quicken", lambda patch: None)
            run_plainly(patch)
            found.append(played(settings))
    for ours, own in zip(*found, strict=True):
        np.testing.assert_array_equal(ours, own)

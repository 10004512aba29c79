"""A long run of a batch with drawn arms, in two processes: memory stays flat, and the bits are the same."""

import hashlib
import mmap
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

from flexarm_agents.environments import make_batch
from tests.hardening.strategies import amount

ENVIRONMENT = "FlexArm/SquareUnknown-v0"
LANES = 256
TABLE = 61  # actions that come round; no divisor of a lap's length
HASHED_EVERY = 1000  # steps of the batch
SETTLED = 0.02  # share of the run after which memory must not grow
FLAT = 5.0  # growth that counts as none [MB]


class Run(NamedTuple):
    episodes: int  # that ended
    digest: str  # of observations and rewards along the way and at the end
    grown: float  # memory at the end less that after a while [MB]


def run_batch(steps: int) -> Run:
    """Step a batch, whose episodes begin anew when they end."""
    env = make_batch(ENVIRONMENT, LANES)
    rng = np.random.default_rng(3)
    strength = rng.uniform(0.0, 0.6, (1, LANES, 1))
    table = (strength * rng.uniform(-1.0, 1.0, (TABLE, LANES, 2))).astype(np.float32)
    env.reset(seed=3)
    count, digest, episodes, settled = -(-steps // LANES), hashlib.sha256(), 0, 0.0
    for n in range(count):
        observation, reward, terminated, truncated, _ = env.step(table[n % TABLE])
        episodes += int(np.count_nonzero(terminated | truncated))
        if n % HASHED_EVERY == 0 or n == count - 1:
            assert np.isfinite(observation).all()
            assert np.isfinite(reward).all()
            digest.update(observation.tobytes())
            digest.update(reward.tobytes())
        if n == int(SETTLED * count):
            settled = resident()
    return Run(episodes, digest.hexdigest(), resident() - settled)


def resident() -> float:
    """Return the memory of this process [MB]."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * mmap.PAGESIZE / 1e6


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="needs /proc")
def test_memory_stays_flat_and_processes_agree() -> None:
    steps = amount(10_000_000, 100_000_000)  # a leak of a byte for a step shows
    with ProcessPoolExecutor(1, get_context("spawn"), max_tasks_per_child=1) as pool:
        one, other = pool.map(run_batch, [steps, steps])
    assert one.digest == other.digest
    assert one.episodes > 0
    assert max(one.grown, other.grown) < FLAT

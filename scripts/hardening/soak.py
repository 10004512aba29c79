"""A long run of a batch with drawn plants, in two processes: memory stays flat, and the bits are the same."""

from __future__ import annotations

import hashlib
import mmap
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np

from flexarm_agents.environments import make_batch

ENVIRONMENT = "FlexArm/SquareUnknown-v0"
LANES = 256
TABLE = 61  # actions that come round; no divisor of a lap's length
HASHED_EVERY = 1000  # steps of the batch
SETTLED = 0.02  # share of the run after which memory must not grow
PROCESSES = 2


def soak(steps: int, seed: int) -> dict[str, Any]:
    """Run a batch, whose episodes begin anew when they end.

    Args:
        steps: environment steps, rounded up to whole steps of the batch.
        seed: of plants and actions.

    Returns:
        Steps and episodes, a hash of observations and rewards along the way and at the end, memory after a while and
        at the end [MB], processor time [s].
    """
    env = make_batch(ENVIRONMENT, LANES)
    rng = np.random.default_rng(seed)
    strength = rng.uniform(0.0, 0.6, (1, LANES, 1))
    table = (strength * rng.uniform(-1.0, 1.0, (TABLE, LANES, 2))).astype(np.float32)
    observation, _ = env.reset(seed=seed)
    count, digest, episodes, settled = -(-steps // LANES), hashlib.sha256(), 0, 0.0
    began = time.process_time()
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
        if n % (count // 10 or 1) == 0:
            print(f"soak: {n * LANES:,} of {steps:,} steps", file=sys.stderr, flush=True)
    return {
        "steps": count * LANES,
        "episodes": episodes,
        "hash": digest.hexdigest()[:32],
        "settled": settled,
        "end": resident(),
        "seconds": time.process_time() - began,
    }


def resident() -> float:
    """Return the memory of this process [MB].

    Raises:
        OSError: on a system without /proc.
    """
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * mmap.PAGESIZE / 1e6

"""What keeps PPO's swing lap from the best plan's: starts, branches, limits, the reward, a curriculum, a teacher."""

from __future__ import annotations

from typing import Any

from flexarm_agents import TrainingConfig

STEPS = 1_000_000
FINER = {"tracking_wide": 0.4, "tracking_middle": 0.25, "tracking_fine": 0.35}
WAYS: dict[str, dict[str, Any]] = {
    "mix": {},
    "corner": {"options": {"start": "corner"}, "episode_steps": 1600},
    "corners": {"options": {"start": "corners"}},
    "moving": {"options": {"start": "moving"}},
    "spread": {"options": {"start_spread": [0.2, 0.2]}},
    "short": {"episode_steps": 150},
    "directions": {"options": {"direction": "either"}},
    "gamma": {"gamma": 0.995},
    "reward": {"options": {"reward_weights": FINER}},
}


def config_of(way: str) -> TrainingConfig:
    """Return the configuration of an agent.

    Args:
        way: a name in `WAYS`.
    """
    return TrainingConfig(steps=STEPS, evaluate_every=STEPS // 10, **WAYS[way])

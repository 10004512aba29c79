"""The environments' ids."""

from __future__ import annotations

import gymnasium

# The paper's lap: 16 000 control periods of 1 ms. `env.CONTROL_PERIOD` and `SquareParameters.lap_time` say the
# same; a test ties the three together.
_PAPER_STEPS = 16_000


def register_environments() -> None:
    """Register all ids with Gymnasium; doing it again changes nothing."""
    if "FlexArm/Paper-v0" not in gymnasium.registry:
        gymnasium.register(
            id="FlexArm/Paper-v0",
            entry_point="flexarm_env.env:FlexArmEnv",
            max_episode_steps=_PAPER_STEPS,
        )

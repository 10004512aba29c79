"""Option sets: an environment is made of them, or they are refused by the name of one."""

from __future__ import annotations

from collections import Counter
from typing import Any

from flexarm_env.envs.single import FlexArmEnv
from scripts.hardening.campaign import Part
from scripts.hardening.strategies import any_options, check_refusal


def construct(options: dict[str, Any]) -> Counter[str]:
    """Make an environment; nothing is compiled before its first reset."""
    try:
        env = FlexArmEnv(**options)
    except Exception as error:
        check_refusal(error, options)
        return Counter(refused=1)
    assert env.observation_space.shape
    env.close()
    return Counter(taken=1)


PART = Part(
    "environments made with one to four options: allowed values, edges of the ranges, values just beyond, garbage",
    "option set",
    any_options,
    construct,
    limit=120.0,
    size=500,
)

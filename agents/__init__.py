"""Agents that learn: an adapter for stable-baselines3, training, and policies that were trained."""

from flexarm_agents.vec_env import FlexArmVecEnv

__all__ = ["FlexArmVecEnv"]

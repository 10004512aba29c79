"""`AsymmetricPolicy`: PPO's policy and value on different parts of an observation.

Source: Pinto et al., *Asymmetric actor critic for image-based robot learning*, RSS 2018.
"""

from typing import Any

import torch
from gymnasium.spaces import Space
from stable_baselines3.common.policies import ActorCriticPolicy
from stable_baselines3.common.torch_layers import BaseFeaturesExtractor, MlpExtractor


class FirstNumbers(BaseFeaturesExtractor):
    """The first numbers of an observation."""

    def __init__(self, space: Space[Any], count: int) -> None:
        super().__init__(space, count)

    def forward(self, observations: torch.Tensor) -> torch.Tensor:
        """Return them. Shape (n, count)."""
        return observations[:, : self.features_dim]


class AsymmetricPolicy(ActorCriticPolicy):
    """The value sees the whole observation, the policy all but the last `privileged` numbers of it."""

    def __init__(self, *args: Any, privileged: int, **kwargs: Any) -> None:
        self._privileged = privileged
        super().__init__(*args, **kwargs | {"share_features_extractor": False})

    def _build_mlp_extractor(self) -> None:
        super()._build_mlp_extractor()
        seen = self.features_dim - self._privileged
        self.pi_features_extractor = self.features_extractor = FirstNumbers(self.observation_space, seen)
        actor = MlpExtractor(seen, self.net_arch, self.activation_fn, self.device)
        self.mlp_extractor.policy_net = actor.policy_net

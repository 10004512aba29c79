"""`ChainEnv`: the chain as a Gymnasium environment. Glue only."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

from flexarm_env.chain.plant import ChainPlant
from flexarm_env.envs.hosted import HostedSimulator
from flexarm_env.envs.registration import ChainOptions
from flexarm_env.envs.settings import Settings
from flexarm_env.envs.single import FlexArmEnv
from flexarm_env.validation import known_names


class ChainEnv(FlexArmEnv):
    """`FlexArmEnv` with a chain of rigid segments in MuJoCo in the place of the arm of assumed modes.

    Action, observation, reward, resets and infos are the same, by the same code: only what the motors move is another
    plant, which no controller's model contains. Beside the options of `flexarm_env.envs.settings.Settings` it takes
    those of `flexarm_env.envs.registration.ChainOptions`. Many of them run in Gymnasium's own vector environments.
    """

    def __init__(self, render_mode: str | None = None, **options: Any) -> None:
        """Lay out the environment.

        Args:
            render_mode: "rgb_array", "human" or None.
            **options: fields of `Settings` and of `ChainOptions`.
        """
        known_names(
            type(self).__name__, options, [one.name for kind in (ChainOptions, Settings) for one in fields(kind)]
        )
        own = {one.name: options.pop(one.name) for one in fields(ChainOptions) if one.name in options}
        self.chain_options = ChainOptions(**own)
        super().__init__(render_mode, **options)

    def _simulator_of(self, settings: Settings) -> HostedSimulator:
        return HostedSimulator(settings, ChainPlant(settings, self.chain_options))

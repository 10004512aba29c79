"""Configurations of the algorithms that learn by reward, as stable-baselines3 and sb3-contrib have them.

Fields that are not given have the tuned values of the files in `hyperparams`.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Literal, Self

from flexarm_agents.environments import check_id, check_options, settings_of
from flexarm_agents.policies.encoders import LONGEST_LAG, checked_increasing
from flexarm_agents.policies.network import ACTIVATIONS
from flexarm_agents.policies.observer import KINDS, check_observed
from flexarm_agents.training.config import Activation, RunConfig, layers, optional, setting, text
from flexarm_agents.training.hyperparameters import CURRICULUM, names_in_zoo, tuned
from flexarm_agents.training.randomisation import check_ranges
from flexarm_env.validation import choice, flag, integer, mapping, number, shown

ObserverName = Literal["none", "nominal", "delay"]
PRIVILEGED_BLOCKS = ("state", "episode_parameters")  # what a privileged critic sees beside the policy's observation
_TUNED: Any = None  # the value of the file, unless another one is given


@dataclass(frozen=True, kw_only=True)
class RewardConfig(RunConfig):
    """Fields of all algorithms that learn by reward."""

    training: ClassVar[str] = "flexarm_agents.training.reward:RewardTraining"
    kind: ClassVar[str]  # "module:class" of the algorithm
    policy: ClassVar[str] = "MlpPolicy"

    steps: int = setting(_TUNED, integer, "n_timesteps", least=1)
    """Environment steps of the training, rounded up to whole rollouts."""
    envs: int = setting(_TUNED, integer, "n_envs", least=1)
    """Environments side by side."""
    batch: int = setting(_TUNED, integer, "batch_size", least=2)
    """Steps in a minibatch; of PPO it must divide rollout times envs."""
    episode_steps: int = setting(_TUNED, integer, "env_kwargs.max_episode_steps", least=1)
    """Control periods after which a training episode is cut off, its value bootstrapped."""
    gamma: float = setting(_TUNED, number, "gamma", least=0.0, most=1.0)
    """Discount of a step."""
    learning_rate: float = setting(_TUNED, number, "learning_rate", above=0.0, most=1.0)
    """Learning rate at the beginning; it falls linearly."""
    final_learning_rate: float = setting(2e-5, number, least=0.0)
    """Learning rate at the end."""
    hidden: tuple[int, ...] = setting(_TUNED, layers, "policy_kwargs.net_arch")
    """Sizes of the hidden layers, of the policy and of the value each."""
    activation: Activation = setting(_TUNED, choice, "policy_kwargs.activation_fn", allowed=ACTIVATIONS)
    """Activation function between the layers."""
    curriculum_options: dict[str, Any] = setting(_TUNED, mapping)
    """Options in which the training's environments differ from the environment of the score, e.g. a slower lap."""
    curriculum_steps: int | None = setting(None, optional, check=integer, least=1)
    """Steps until which `curriculum_options` hold, rounded up to whole rollouts; None: to the end."""
    automatic_randomisation: bool = setting(False, flag)
    """Ranges of `randomisation` begin narrow, and widen while few episodes are lost (`training.randomisation`)."""
    evaluate_every: int = setting(50_000, integer, least=1)
    """Steps between two evaluations, rounded up to whole rollouts."""
    checkpoint_every: int = setting(250_000, integer, least=1)
    """Steps between two checkpoints, rounded up to whole rollouts."""

    def __post_init__(self) -> None:
        """Take the tuned values of the fields that are not given; validate.

        Raises:
            ModuleNotFoundError: without the package that reads the file, naming the extra.
        """
        missing = [name for name in (*names_in_zoo(type(self)), CURRICULUM) if getattr(self, name) is None]
        found = tuned(type(self), check_id(self.environment)) if missing else {}
        for name in missing:
            object.__setattr__(self, name, self._fitting(found[name]) if name == CURRICULUM else found[name])
        super().__post_init__()
        if self.final_learning_rate > self.learning_rate:
            raise ValueError(
                f"final_learning_rate = {self.final_learning_rate}: must be <= learning_rate = {self.learning_rate}"
            )
        if self.automatic_randomisation:
            if self.curriculum_steps is not None:
                raise ValueError(
                    f"curriculum_steps = {self.curriculum_steps}: must be left out with automatic_randomisation"
                )
            check_ranges(settings_of(self.environment, self.options | self.curriculum_options))
        if self.curriculum_steps is not None and (not self.curriculum_options or self.curriculum_steps >= self.steps):
            raise ValueError(
                f"curriculum_steps = {self.curriculum_steps}: must go with curriculum_options, and be < steps = "
                f"{self.steps}"
            )

    @classmethod
    def of(cls, values: Mapping[str, Any]) -> Self:
        """See `RunConfig`; files of versions without a curriculum have none."""
        return super().of({"lesson_options": {}, **values})

    def _fitting(self, curriculum: dict[str, Any]) -> dict[str, Any]:
        """Return tuned options of the curriculum as far as the configuration's own options leave them an effect."""
        options = mapping("options", self.options)
        own = {name: value for name, value in curriculum.items() if name not in options}
        try:
            check_options(check_id(self.environment), {**options, **own})
        except (TypeError, ValueError):  # either the options are bad by themselves, which is found later, or own ones
            return {}
        return own


@dataclass(frozen=True, kw_only=True)
class _OnPolicyConfig(RewardConfig):
    """Fields of PPO and RecurrentPPO."""

    rollout: int = setting(_TUNED, integer, "n_steps", least=1)
    """Steps of each environment between two updates."""
    epochs: int = setting(_TUNED, integer, "n_epochs", least=1)
    """Passes through a rollout in an update."""
    gae_lambda: float = setting(_TUNED, number, "gae_lambda", least=0.0, most=1.0)
    """Smoothing of the advantages."""
    clip: float = setting(_TUNED, number, "clip_range", above=0.0)
    """Range of the probabilities' ratio."""
    entropy: float = setting(_TUNED, number, "ent_coef", least=0.0)
    """Weight of the entropy."""
    log_std: float = setting(_TUNED, number, "policy_kwargs.log_std_init", least=-10.0, most=2.0)
    """Logarithm of the actions' standard deviation at the beginning."""

    def __post_init__(self) -> None:
        super().__post_init__()
        size = self.rollout * self.envs
        if size < 2 or self.batch > size or size % self.batch:
            raise ValueError(
                f"batch = {shown(self.batch)}: must divide rollout * envs = {shown(self.rollout)} * "
                f"{shown(self.envs)} = {shown(size)}"
            )


@dataclass(frozen=True, kw_only=True)
class PPOConfig(_OnPolicyConfig):
    """PPO, of stable-baselines3."""

    algorithm: ClassVar[str] = "ppo"
    kind: ClassVar[str] = "stable_baselines3:PPO"

    lags: tuple[int, ...] = setting((), checked_increasing, least=1, most=LONGEST_LAG)
    """Ages of the readings that the policy sees beside the present ones [control periods]."""
    observer: ObserverName = setting("none", choice, allowed=KINDS)
    """Kalman filter in place of late readings: none, with the nominal delay, or one that estimates the delay."""
    privileged_critic: bool = setting(False, flag)
    """The value sees the arm's true state and the episode's parameters, too; the policy does not."""
    initial_policy: str | None = setting(None, optional, check=text, what="a folder, a file or a name")
    """Policy whose network the training begins with: folder of a training, npz file or name of a shipped one."""
    value_steps: int = setting(0, integer, least=0)
    """After `initial_policy`: steps at the beginning in which the value learns alone, whole rollouts of them."""
    value_learning_rate: float = setting(1e-3, number, above=0.0, most=1.0)
    """Learning rate in these steps, which do not count in the fall of `learning_rate`."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.initial_policy is not None and self.observer != "none":
            raise ValueError(
                f"initial_policy = {shown(self.initial_policy)}, observer = {self.observer!r}: the network behind an "
                "observer begins untrained"
            )
        if self.value_steps and (self.initial_policy is None or self.value_steps >= self.steps):
            raise ValueError(
                f"value_steps = {self.value_steps}: must go with initial_policy, and be < steps = {self.steps}"
            )
        if self.lags and self.observer != "none":
            raise ValueError(f"lags = {self.lags}, observer = {self.observer!r}: a policy has one of them at most")
        if self.observer != "none":
            check_observed(settings_of(self.environment, self.options))
        seen = settings_of(self.environment, self.options).observation
        if self.privileged_critic and not set(PRIVILEGED_BLOCKS).isdisjoint(seen):
            raise ValueError(f"privileged_critic = True: the policy must see neither of {PRIVILEGED_BLOCKS}")


@dataclass(frozen=True, kw_only=True)
class RecurrentPPOConfig(_OnPolicyConfig):
    """RecurrentPPO, of sb3-contrib."""

    algorithm: ClassVar[str] = "recurrent_ppo"
    kind: ClassVar[str] = "sb3_contrib:RecurrentPPO"
    policy: ClassVar[str] = "MlpLstmPolicy"

    lstm: int = setting(_TUNED, integer, "policy_kwargs.lstm_hidden_size", least=1)
    """Size of the memory, an LSTM."""
    critic_lstm: bool = setting(_TUNED, flag, "policy_kwargs.enable_critic_lstm")
    """The value has an LSTM of its own; else it sees the outputs of the policy's LSTM."""


@dataclass(frozen=True, kw_only=True)
class SACConfig(RewardConfig):
    """SAC, of stable-baselines3."""

    algorithm: ClassVar[str] = "sac"
    kind: ClassVar[str] = "stable_baselines3:SAC"

    buffer: int = setting(_TUNED, integer, "buffer_size", least=1)
    """Steps that are kept for learning; must be a multiple of envs."""
    learning_starts: int = setting(_TUNED, integer, "learning_starts", least=0)
    """Steps of random actions before the first update."""
    tau: float = setting(_TUNED, number, "tau", above=0.0, most=1.0)
    """Rate at which the target networks follow."""
    train_every: int = setting(_TUNED, integer, "train_freq", least=1)
    """Steps of each environment between updates."""
    updates: int = setting(_TUNED, integer, "gradient_steps", least=1)
    """Number of updates after `train_every` steps."""
    temperature: float = setting(_TUNED, number, "ent_coef", above=0.0)
    """Weight of the entropy at the beginning; it is learned."""
    critics: int = setting(_TUNED, integer, "policy_kwargs.n_critics", least=1)
    """Number of critics."""
    evaluate_every: int = setting(5_000, integer, least=1)
    """Steps between two evaluations, rounded up to whole rollouts."""
    checkpoint_every: int = setting(25_000, integer, least=1)
    """Steps between two checkpoints, rounded up to whole rollouts."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.buffer % self.envs or self.buffer < self.batch:
            raise ValueError(
                f"buffer = {shown(self.buffer)}: must be a multiple of envs = {self.envs}, and >= batch = {self.batch}"
            )


@dataclass(frozen=True, kw_only=True)
class TQCConfig(SACConfig):
    """TQC, of sb3-contrib."""

    algorithm: ClassVar[str] = "tqc"
    kind: ClassVar[str] = "sb3_contrib:TQC"

    quantiles: int = setting(_TUNED, integer, "policy_kwargs.n_quantiles", least=1)
    """Number of quantiles of each critic."""
    dropped_quantiles: int = setting(_TUNED, integer, "top_quantiles_to_drop_per_net", least=0)
    """Number of the largest quantiles that are dropped."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.dropped_quantiles >= self.quantiles:
            raise ValueError(f"dropped_quantiles = {self.dropped_quantiles}: must be < quantiles = {self.quantiles}")

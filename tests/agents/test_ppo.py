"""PPO with its gradients written out does what the library does."""

from __future__ import annotations

from copy import deepcopy
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from stable_baselines3 import PPO

from flexarm_agents import TrainingConfig
from flexarm_agents.sb3.ppo import LeanPPO
from flexarm_agents.training.models import hold_policy, new_model
from tests.support.trainings import TINY

ROUNDING = 2e-5  # relative; derivatives are in single precision, and so are Adam's quotients of them
TIMES = 2  # of updates, so that the optimiser's state is taken over


def model_of(**changes: Any) -> Any:
    """Return a model after its first rollout."""
    model: Any = new_model(TrainingConfig(**{**TINY, **changes}))
    model._setup_learn(1000)
    model.collect_rollouts(model.env, model._init_callback(None), model.rollout_buffer, model.n_steps)
    return model


def outcome(model: Any, kind: type[PPO], seed: int) -> dict[str, Any]:
    """Return parameters, moments and logged figures after some updates; the model is put back."""
    before = deepcopy((model.policy.state_dict(), model.policy.optimizer.state_dict()))
    np.random.seed(seed)  # noqa: NPY002
    for _ in range(TIMES):
        kind.train(model)
    state = model.policy.optimizer.state
    found: dict[str, Any] = dict(model.logger.name_to_value)
    for name, one in model.policy.named_parameters():
        found[name] = one.detach().numpy().copy()
        found |= {f"{name} {key}": value.numpy().copy() for key, value in state[one].items()}
    model.policy.load_state_dict(before[0])
    model.policy.optimizer.load_state_dict(before[1])
    model._n_updates = 0
    return found


@settings(max_examples=12)
@given(
    hidden=st.lists(st.integers(1, 20), min_size=1, max_size=3),
    activation=st.sampled_from(["elu", "tanh", "relu"]),
    batch=st.sampled_from([32, 64, 128]),
    clip=st.floats(0.01, 0.5),
    entropy=st.sampled_from([0.0, 0.02]),
    largest=st.sampled_from([1e-3, 0.5, 100.0]),
    seed=st.integers(0, 5),
)
def test_the_library_gives_the_same(
    hidden: list[int], activation: str, batch: int, clip: float, entropy: float, largest: float, seed: int
) -> None:
    """Parameters, the optimiser's state, and what is logged; gradients are cut off, or not."""
    model = model_of(hidden=hidden, activation=activation, batch=batch, clip=clip, entropy=entropy, seed=seed)
    model.max_grad_norm = largest
    before = model.policy.log_std.detach().numpy().copy()
    ours, theirs = (outcome(model, kind, seed) for kind in (LeanPPO, PPO))
    assert ours.keys() == theirs.keys()
    for name, value in theirs.items():
        scale = float(np.abs(value).max()) if isinstance(value, np.ndarray) else max(abs(value), 0.1)
        np.testing.assert_allclose(ours[name], value, rtol=0.0, atol=ROUNDING * scale + 1e-9, err_msg=name)
    assert not np.array_equal(theirs["log_std"], before)


def test_the_written_gradients_are_used(monkeypatch: pytest.MonkeyPatch) -> None:
    """A training's model has them, and does without the library's."""
    model = model_of()
    assert type(model) is LeanPPO
    monkeypatch.setattr(PPO, "train", None)
    model.train()


def held(model: Any) -> None:
    hold_policy(model, True)


def divergence(model: Any) -> None:
    model.target_kl = 0.01


def clipped_value(model: Any) -> None:
    model.clip_range_vf = lambda left: 0.2


def decayed(model: Any) -> None:
    model.policy.optimizer = torch.optim.AdamW(model.policy.parameters())


def other_layers(model: Any) -> None:
    model.policy.mlp_extractor.policy_net.append(torch.nn.LayerNorm(8))


def was_held(model: Any) -> None:
    """Let the value learn alone first, so that the optimiser has moments of it, and none of the policy."""
    hold_policy(model, True)
    model.train()
    hold_policy(model, False)


@pytest.mark.parametrize("change", [held, was_held, divergence, clipped_value, decayed, other_layers])
def test_else_the_library_learns(change: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    model = model_of()
    change(model)
    calls = []
    monkeypatch.setattr(PPO, "train", lambda self: calls.append(self))
    model.train()
    assert calls == [model]


def test_a_saved_model_is_one_of_the_library(tmp_path: Path) -> None:
    """It goes on there with the optimiser's state."""
    model = model_of()
    model.train()
    model.save(tmp_path / "model.zip")
    loaded: Any = PPO.load(tmp_path / "model.zip", env=model.env)
    loaded.rollout_buffer, loaded._logger = model.rollout_buffer, model.logger
    for one, other in ((model, LeanPPO), (loaded, PPO)):
        np.random.seed(3)  # noqa: NPY002
        other.train(one)
    for mine, theirs in zip(model.policy.parameters(), loaded.policy.parameters(), strict=True):
        np.testing.assert_allclose(mine.detach(), theirs.detach(), rtol=1e-4, atol=1e-6)

"""Sequences of a recurrent policy at once give what sb3-contrib gives period by period."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from sb3_contrib.common.recurrent.policies import RecurrentActorCriticPolicy

from flexarm_agents import TrainingConfig
from flexarm_agents.sb3.recurrent import SequencePolicy
from flexarm_agents.training.models import new_model
from tests.support.trainings import TINIES

INPUTS, SIZE = 3, 5


def outcome(policy: type[RecurrentActorCriticPolicy], starts: np.ndarray, seed: int) -> list[np.ndarray]:
    """Return outputs, memory, and gradients of a sum over both by weights, features and memory."""
    torch.manual_seed(seed)
    sequences, periods = starts.shape
    lstm = torch.nn.LSTM(INPUTS, SIZE).double()
    features = torch.randn(sequences * periods, INPUTS, dtype=torch.float64, requires_grad=True)
    memory = tuple(torch.randn(1, sequences, SIZE, dtype=torch.float64, requires_grad=True) for _ in range(2))
    flags = torch.as_tensor(starts, dtype=torch.float64).flatten()
    outputs, after = policy._process_sequence(features, memory, flags, lstm)
    (outputs.square().sum() + sum(one.sin().sum() for one in after)).backward()
    leaves = [features, *memory, *lstm.parameters()]
    return [one.detach().numpy() for one in (outputs, *after)] + [one.grad.numpy() for one in leaves]


@given(
    st.integers(1, 4).flatmap(
        lambda periods: st.lists(st.lists(st.booleans(), min_size=periods, max_size=periods), min_size=1, max_size=4)
    ),
    st.integers(0, 9),
)
def test_the_library_gives_the_same(starts: list[list[bool]], seed: int) -> None:
    """Episodes may begin anywhere; in double precision, to a few roundings."""
    ours, theirs = (outcome(policy, np.array(starts), seed) for policy in (SequencePolicy, RecurrentActorCriticPolicy))
    for one, other in zip(ours, theirs, strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-12, atol=1e-13)


def test_a_training_has_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """Learning calls the layer once a minibatch, also where an episode begins."""
    model = new_model(TrainingConfig(**{**TINIES["recurrent_ppo"], "episode_steps": 20}))
    calls = []
    memory = model.policy.lstm_actor
    monkeypatch.setattr(memory, "forward", lambda *given: calls.append(0) or type(memory).forward(memory, *given))
    model._setup_learn(0)
    model.collect_rollouts(model.env, model._init_callback(None), model.rollout_buffer, model.n_steps)
    assert model.rollout_buffer.episode_starts[1:].any()
    calls.clear()
    model._current_progress_remaining = 1.0
    model.train()
    assert len(calls) == model.n_epochs * model.n_steps * model.n_envs // model.batch_size

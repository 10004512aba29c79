"""The safety filter: what the network sees, when it acts, and what it makes of a bad one."""

from collections.abc import Iterator
from copy import copy
from functools import cache, partialmethod
from typing import Any

import gymnasium
import numpy as np
import pytest

from flexarm_agents import load_policy
from flexarm_agents.board.entries import FILTERED, Entry
from flexarm_agents.evaluation.candidates import ENVIRONMENT, Candidate
from flexarm_agents.policies.safety_filter import HORIZON, OWN, SHARES, SafetyFilter
from flexarm_baselines.controller import Seen
from flexarm_baselines.lqg import AdaptiveLQG
from flexarm_env.envs.registration import UNKNOWN_PLANT
from flexarm_env.laps import LAPS
from tests.support.refusals import refuses

(ENTRY,) = FILTERED
PUSH = np.array([0.5, -0.5], dtype=np.float32)


class Proposes:
    """A policy whose action a test sets; it remembers how long its episode has lasted."""

    def __init__(self, action: Any = PUSH) -> None:
        self.action = action

    def predict(self, observation: Any, state: Any = None, begins: Any = None) -> Any:
        age = np.zeros(len(observation)) if state is None else np.where(begins, 0.0, state[0])
        return np.broadcast_to(self.action, (len(observation), 2)), (age + 1.0,)


def made(**options: Any) -> gymnasium.Env[Any, Any]:
    return gymnasium.make(ENVIRONMENT, **{**SafetyFilter.options(), **options})


@pytest.fixture(scope="module", autouse=True)
def few_nodes() -> Iterator[None]:
    """Let the backup have two nodes: to design the shipped grid takes longer than all that is tested here."""
    few = partialmethod(AdaptiveLQG.__init__, payloads=(0.0, 0.25), stiffnesses=(1.0,))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(AdaptiveLQG, "__init__", few)
        yield


@cache
def designed() -> SafetyFilter:
    return SafetyFilter.for_env(made())


def around(policy: Any = None) -> SafetyFilter:
    """Return the filter around a policy; None: the network."""
    found = copy(designed())
    found._policy = policy or found._policy
    return found


def backup() -> Any:
    """Return the backup without the filter; `test_a_tube_has_a_width` sees that it is designed as ever."""
    found: Any = copy(designed())
    found.__class__ = AdaptiveLQG
    return found


def observed(count: int, steps: int) -> list[Any]:
    """Return what unknown arms observe that no torque drives."""
    envs = gymnasium.make_vec(ENVIRONMENT, count, **SafetyFilter.options() | UNKNOWN_PLANT)
    found = [envs.reset(seed=3, options={"start": "corner"})[0]]
    found += [envs.step(np.zeros((count, 2), np.float32))[0] for _ in range(steps)]
    envs.close()
    return found


def test_the_network_sees_what_it_was_trained_on() -> None:
    """Vectors are turned by the encoder's angle; the observation of its own environment has them so."""
    trained, rng = load_policy(SafetyFilter.network), np.random.default_rng(0)
    own, union = trained.make_env(**UNKNOWN_PLANT), made(**UNKNOWN_PLANT)
    begin = {"seed": 5, "options": {"start": "corner"}}
    theirs, ours = own.reset(**begin)[0], union.reset(**begin)[0]
    controller = around()
    for _ in range(30):
        seen = controller.shown(Seen(controller.task, ours[None]))[0]
        np.testing.assert_allclose(seen, theirs, rtol=0, atol=2e-5)
        action = rng.uniform(-1.0, 1.0, 2).astype(np.float32)
        theirs, ours = own.step(action)[0], union.step(action)[0]
    assert np.abs(ours[controller.task.blocks["previews"]] - theirs[-30:-16]).max() > 0.1  # another frame


def test_it_observes_what_both_do_and_declares_it(monkeypatch: pytest.MonkeyPatch) -> None:
    blocks, network = SafetyFilter.options()["observation"], load_policy(SafetyFilter.network)
    assert set(blocks) == {*AdaptiveLQG.blocks, *network.options["observation"]}
    assert len(set(blocks)) == len(blocks)
    assert set(ENTRY.interface["observation"]) == set(blocks)
    own = Candidate(ENTRY.name, around(), made(), ENVIRONMENT, {})
    monkeypatch.setattr(Entry, "candidate", lambda self: own)
    assert ENTRY.batched
    assert own.reads == ("encoders", "late tip", "preview", "plant parameters")
    with refuses(ValueError, "SafetyFilter reads the block"):
        SafetyFilter.for_env(gymnasium.make(ENVIRONMENT, **AdaptiveLQG.options()))


def test_a_tube_has_a_width(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(AdaptiveLQG, "__init__", lambda self, task: None)
    with refuses(ValueError, "tube = 0.0"):
        SafetyFilter.for_env(made(), tube=0.0)


def test_the_backups_own_proposals_act_and_change_nothing() -> None:
    proposes = Proposes()
    behind, alone = around(proposes), backup()
    env = made()
    observation, _ = env.reset(seed=0, options=LAPS["plain"].reset_options())
    memory = own = None
    shares = []
    for _ in range(80):
        expected, own = alone.predict(observation, own)
        proposes.action = expected
        action, memory = behind.predict(observation, memory)
        np.testing.assert_allclose(action, expected, atol=1e-5)
        for part, other in zip(memory[:OWN], own, strict=True):
            np.testing.assert_allclose(part, other, rtol=1e-4, atol=1e-4)
        shares.append(memory[OWN][0])
        observation, *_ = env.step(action)
    # at first the backup believes in another arm, which it drives hard; it acts there, which is the same
    assert min(shares[10:]) == 1.0


def test_torques_that_act_move_the_belief_as_the_backups_own_filter_would() -> None:
    """What follows from other torques is what `AdaptiveLQG` predicts when it commands these itself."""
    observations, torques = observed(3, 1)[1], np.array([40.0, -15.0])
    behind, alone = around(), backup()
    seen = Seen(behind.task, observations)
    memory = alone.start(seen)
    alone.limited = lambda torque: np.broadcast_to(torques, torque.shape)
    _, expected = alone.torque(seen, memory)
    _, after = AdaptiveLQG.torque(behind, seen, memory)
    found = behind._followed_by(seen.period, after, np.tile(torques, (3, 1)))
    assert np.abs(after[0] - expected[0]).max() > 0.01
    for part, other in zip(found, expected, strict=True):
        np.testing.assert_allclose(part, other, rtol=1e-5, atol=1e-6)


@pytest.mark.parametrize("lap", LAPS)
def test_a_push_that_loses_the_arm_does_not_behind_the_filter(lap: str) -> None:
    env, behind, memory = made(), around(Proposes()), None
    begin = LAPS[lap].reset_options()
    observation, _ = env.reset(seed=0, options=begin)
    ended = [env.step(PUSH)[2] for _ in range(80)]
    assert any(ended)
    observation, _ = env.reset(seed=0, options=begin)
    for _ in range(160):
        action, memory = behind.predict(observation, memory)
        observation, _, terminated, _, _ = env.step(action)
        assert not terminated


def test_what_is_predicted_of_the_backup_is_what_it_does() -> None:
    """On the default arm, up to and beyond a corner: the largest error and bending of each horizon."""
    env, behind, alone, found, told = made(), around(), backup(), [], {}
    observation, info = env.reset(seed=0, options=LAPS["plain"].reset_options())
    memory, arm = None, behind.plans[0].arm
    for k in range(460):
        action, memory = alone.predict(observation, memory)
        observation, _, _, _, info = env.step(action)
        found.append((info["tip_error"], np.abs(arm.tip_deflection(info["state"][: arm.size])).max()))
        if k >= 200 and k % 10 == 0:
            told[k] = behind.predicted(np.array([k]), memory)[0]
    for k in range(200, len(found) - HORIZON, 10):
        np.testing.assert_allclose(told[k], np.max(found[k : k + HORIZON], axis=0), atol=1e-3)


def test_no_torque_is_further_from_the_network_than_the_backups() -> None:
    """The action lies between proposal and backup, at one of the shares, and at 0 where nothing is predicted safe."""
    behind, never = around(Proposes()), around(Proposes(-PUSH))
    never.limits = np.zeros(2)
    observation = observed(4, 0)[0]
    for controller, shares in ((behind, {0.0, *SHARES}), (never, {0.0})):
        action, memory = controller.predict(observation)
        alone, _ = backup().predict(observation)
        assert set(memory[OWN]) <= shares
        wanted = alone + memory[OWN][:, None] * (controller._policy.action - alone)
        np.testing.assert_allclose(action, wanted, atol=1e-6)


@pytest.mark.parametrize("own", [True, False])
def test_a_batch_is_its_members_and_an_episode_that_begins_is_a_fresh_one(own: bool) -> None:
    """The memory of each arm goes through the state, the network's too."""
    controller = around() if own else around(Proposes())
    both, single, begun = None, [None, None], None
    for k, observations in enumerate(observed(2, 6)):
        start = np.array([False, k == 4])
        actions, both = controller.predict(observations, both, start)
        for n in (0, 1):
            memory = None if start[n] else single[n]
            action, single[n] = controller.predict(observations[n], memory)
            np.testing.assert_allclose(actions[n], action, atol=1e-5)
        shapes = [part.shape[1:] for part in both]
        assert all(len(part) == 2 for part in both)
        assert begun in (None, shapes)
        begun = shapes
    assert len(both) == OWN + 1 + (not own)
    if not own:
        assert both[-1].tolist() == [7.0, 3.0]

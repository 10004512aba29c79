"""Trained policies: as files, and those that are shipped."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import flexarm_agents.policies.load
from flexarm_agents import (
    NetworkPolicy,
    StandardScore,
    config_of,
    evaluate,
    load_policy,
    network_policy,
    shipped_policies,
    train,
)
from flexarm_agents.evaluation.scoring import rank
from flexarm_agents.training.models import new_model
from tests.support.trainings import TINY, finished

# What trainings reach on each lap: r.m.s. over the lap, and after 2 s [m].
GOALS = {
    "filtered": {"swing": (0.08, 0.06), "plain": (0.06, 0.06)},
    "scheduler": {"swing": (0.8, 0.8), "plain": (0.9, 0.9)},
    "scheduler_paper": {"swing": (0.8, 0.8), "plain": (0.75, 0.8)},
    "square": {"swing": (0.068, 0.04), "plain": (0.037, 0.037)},
    "student": {"swing": (0.064, 0.033), "plain": (0.028, 0.033)},
    "student_gauges": {"swing": (0.064, 0.033), "plain": (0.028, 0.033)},
    "student_unknown": {"swing": (0.15, 0.13), "plain": (0.13, 0.13)},  # the worst of several plants
}


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Run the tiny training once; its folder must not be changed."""
    return finished(tmp_path_factory.mktemp("runs"))


# --- policies as files ------------------------------------------------------------------------------------------------


def test_a_policys_own_randomness() -> None:
    policy = NetworkPolicy([np.zeros((2, 3), np.float32)], [np.zeros(2, np.float32)], np.log(np.float32([0.1, 0.3])))
    policy.seed(1)
    assert not policy.predict(np.zeros((4000, 3)))[0].any()  # the mean, unless asked for more
    first = policy.predict(np.zeros((4000, 3)), deterministic=False)[0]
    np.testing.assert_allclose(first.std(axis=0), [0.1, 0.3], rtol=0.05)
    policy.seed(1)
    np.testing.assert_array_equal(policy.predict(np.zeros((4000, 3)), deterministic=False)[0], first)


def test_bad_policies(tmp_path: Path, run: Path) -> None:
    (tmp_path / "text.npz").write_text("text")
    np.savez(tmp_path / "other.npz", x=np.zeros(3))
    np.savez(tmp_path / "future.npz", head=np.array('{"format": 99}'))
    np.savez(tmp_path / "few.npz", head=np.array('{"format": 1, "layers": 1}'))
    network_policy(new_model(config_of(**TINY))).save(tmp_path / "bare.npz")
    for name, message in [
        ("text.npz", "text.npz: not a saved policy"),
        ("other.npz", "no entry 'head'"),
        ("future.npz", "future.npz: format 99; this version reads 1"),
        ("few.npz", r"few.npz: not a saved policy \(no entry 'weight_0'\)"),
        ("bare.npz", "does not say what it was trained on"),
    ]:
        with pytest.raises(ValueError, match=message):
            load_policy(tmp_path / name)
    with pytest.raises(FileNotFoundError, match=r"the folder holds no best_policy.npz"):
        load_policy(tmp_path)
    with pytest.raises(FileNotFoundError, match=r"source = 'nobody': neither a folder or file nor a shipped policy"):
        load_policy("nobody")
    trained = load_policy(run, last=True)
    with pytest.raises(ValueError, match=r"policy 'tiny': was trained with observation of shape"):
        trained.make_env(last_actions=2)
    with pytest.raises(ValueError, match=r"observation must have shape \(\d+,\) or \(n, \d+\), got \(3,\)"):
        trained.policy.predict(np.zeros(3))
    with pytest.raises(TypeError, match=r"observation must be an array, got a dict"):
        trained.policy.predict({"a": np.zeros(3)})
    with pytest.raises(ValueError, match=r"weights\[1\]: must have shape \(1, 2\), got \(1, 3\)"):
        NetworkPolicy([np.zeros((2, 4)), np.zeros((1, 3))], [np.zeros(2), np.zeros(1)], np.zeros(1))
    with pytest.raises(ValueError, match=r"log_std: must have shape \(2,\)"):
        NetworkPolicy([np.zeros((2, 4))], [np.zeros(2)], np.zeros(1))


# --- shipped policies -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", shipped_policies())
def test_a_shipped_policy_scores_what_it_says(name: str) -> None:
    trained = load_policy(name)
    path = Path(flexarm_agents.policies.load.POLICIES) / f"{name}.npz"
    assert path.stat().st_size < 1_000_000
    beside = json.loads(path.with_suffix(".json").read_text())
    assert set(beside) >= {"command", "config", "evaluation", "choice", "trainings"}
    assert beside["config"] == trained.notes["config"]
    assert beside["evaluation"] == trained.notes["evaluation"]
    env, count = trained.make_env(), trained.notes["config"]["evaluation_laps"]
    again = [evaluate(env, trained.policy, seed=1_000_003 + n) for n in range(count)]
    assert all(one.complete for one in again)
    for lap, (rms, rms_after_2s) in GOALS[name].items():
        found = max((getattr(one, lap) for one in again), key=lambda one: one.rank)
        # another processor's matrix products may round otherwise, which a lap amplifies a little
        assert found.rms == pytest.approx(beside["evaluation"][lap]["rms"], rel=1e-3)
        assert found.rms <= rms
        assert found.rms_after_2s <= rms_after_2s


@pytest.mark.parametrize("name", shipped_policies())
def test_a_shipped_policy_is_the_median_of_its_trainings(name: str) -> None:
    beside = json.loads((flexarm_agents.policies.load.POLICIES / f"{name}.json").read_text())
    ranks = sorted((rank([StandardScore.of(row)]), row["seed"]) for row in beside["trainings"])
    assert len(ranks) % 2 == 1
    assert ranks[len(ranks) // 2][1] == beside["config"]["seed"]
    of_policy = {"seed": beside["config"]["seed"], **beside["evaluation"]}
    assert any(of_policy.items() <= training.items() for training in beside["trainings"])


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_the_defaults_reach_the_goal(tmp_path: Path, seed: int) -> None:
    best = train(config_of(seed=seed), tmp_path / "run").best
    for lap, (rms, rms_after_2s) in GOALS["square"].items():
        assert best[lap]["complete"]
        assert best[lap]["rms"] <= rms
        assert best[lap]["rms_after_2s"] <= rms_after_2s

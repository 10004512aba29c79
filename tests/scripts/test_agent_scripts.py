"""Training and evaluation by the command line: train, stop, go on, evaluate."""

import json
import re
import signal
from pathlib import Path

import gymnasium
import numpy as np
import pytest
from stable_baselines3.common.vec_env import DummyVecEnv, VecNormalize

from flexarm_agents import NetworkPolicy, config_of, shipped_policies
from flexarm_agents.board.entries import Entry
from flexarm_agents.board.measure import PUBLISHED
from flexarm_agents.training.models import new_model
from flexarm_env.laps import LAPS
from tests.support.shell import Shell
from tests.support.trainings import TINY as CONFIG
from tests.support.trainings import at_step, score

TINY = ["--envs", "4", "--rollout", "32", "--batch", "64", "--epochs", "2", "--hidden", "16", "8"]
TINY += ["--episode-steps", "50", "--evaluate-every", "200", "--checkpoint-every", "200"]
ALONE = ("--no-baselines", "--no-shipped")
OUTPUT = ("--output", "scores.json")
SOME = ["scheduler_paper", "square"]


@pytest.mark.usefixtures("signals")
def test_train_and_resume(flexarm: Shell) -> None:
    again = ("train", *TINY, "--steps", "256", "--seed", "3", "--options", '{"noise": 0.001}')
    with at_step(20, lambda: signal.raise_signal(signal.SIGINT)):
        assert "stopped; all 128 steps are kept in runs/Square-v0-ppo-3; " in flexarm(*again, status=130).stderr
    result = flexarm(*again, "--resume")
    assert result.stdout.startswith("      256 steps ")
    assert "best: swing lap: lost after " in result.stdout
    assert result.stdout.endswith("\nnext: flexarm render runs/Square-v0-ppo-3 --output lap.png\n")
    run = flexarm.folder / "runs" / "Square-v0-ppo-3"
    assert json.loads((run / "config.json").read_text())["options"] == {"noise": 0.001}
    assert flexarm(*again, status=1).stderr.startswith("error: folder = runs/Square-v0-ppo-3: exists and is not empty")
    told = flexarm("evaluate", "runs/Square-v0-ppo-3", *ALONE).stdout
    lines = [line for line in told.splitlines() if line.startswith("runs/Square-v0-ppo-3")]
    assert [line.split()[1] for line in lines] == ["swing", "plain"]
    assert told.endswith('--own scores them: runs/Square-v0-ppo-3 on Square-v0 with {"noise": 0.001}\n')
    assert [path.name for path in flexarm.folder.iterdir()] == ["runs"]  # nothing is written unasked
    for line in lines:
        assert "ENDED at " in line
        assert re.search(r" -( +-){3} ", line)  # it has no errors


@pytest.mark.parametrize("names", [SOME, pytest.param(shipped_policies(), marks=pytest.mark.slow)], ids=["some", "all"])
def test_evaluate_scores_what_there_is(flexarm: Shell, monkeypatch: pytest.MonkeyPatch, names: list[str]) -> None:
    monkeypatch.setattr("flexarm_agents.commands.evaluate.shipped_policies", lambda: names)
    result = flexarm("evaluate", *OUTPUT)
    nominal, other, *tasks = result.stdout.split("\n\n")[1:]
    own = ["scheduler_paper"]  # its arm is not the nominal one
    elsewhere = [name for name in ("race", "carry") if name in names]  # tasks of their own
    shipped = [name for name in names if name not in own + elsewhere]
    others = ["ifdc", "flsac", "no torque", "random torque"]
    assert ranked(nominal, [*shipped, *others])[-2:] == others[-2:]
    assert ranked(other, own) == own
    assert [name for table in tasks for name in elsewhere if f"\n{name} " in table] == elsewhere
    assert all("ENDED at " in row and re.search(r" -( +-){3} ", row) for row in nominal.splitlines()[-4:])
    told = [line for line in result.stderr.splitlines() if line.strip() and "|" not in line]  # without bars
    assert {line.partition(":")[0] for line in told} == {*shipped, *own, *elsewhere, *others}
    found = {one["name"]: one for one in flexarm.evaluation()["results"]}
    laps = {name: one["laps"][0] for name, one in found.items()}
    assert laps["ifdc"]["swing"]["complete"]
    assert laps["ifdc"]["swing"]["rms"] == pytest.approx(0.848, abs=5e-3)
    assert not laps["no torque"]["plain"]["complete"]
    assert laps["no torque"]["plain"]["rms_after_2s"] is None
    assert {found[name]["environment"] for name in shipped} == {"FlexArm/Square-v0"}
    board = {row["name"]: row for row in json.loads(PUBLISHED.read_text())["rows"]}
    for name in shipped:
        point = board[f"agent {name}"]["columns"]["nominal"]["points"][0]
        for lap in LAPS:
            assert laps[name][lap]["rms"] == pytest.approx(point[lap]["rms"]["mean"], abs=1e-4)


def ranked(table: str, names: list[str]) -> list[str]:
    """Return the policies of a table in its order, each of which has both laps."""
    rows = [row for row in table.splitlines() if row.startswith(tuple(names))]
    found = [(name, lap) for row in rows for name in names for lap in LAPS if re.match(rf"{name} +{lap} ", row)]
    order = [name for name, _ in found[::2]]
    assert found == [(name, lap) for name in order for lap in LAPS]
    assert sorted(order) == sorted(names)
    return order


def test_a_policy_alone_is_scored_alone(flexarm: Shell) -> None:
    flexarm("evaluate", "--policy", "ifdc", "--environment", "Track-v0", *OUTPUT)
    (found,) = flexarm.evaluation()["results"]
    assert (found["name"], found["environment"]) == ("ifdc", "FlexArm/Track-v0")
    assert found["options"]["action_mode"] == "gain"
    assert found["reads"] == ["encoders"]
    assert not found["privileged"]


def test_other_plants_have_tables_of_their_own(flexarm: Shell, monkeypatch: pytest.MonkeyPatch) -> None:
    """A policy that is named twice is scored once."""
    monkeypatch.setattr("flexarm_agents.commands.evaluate.evaluate", lambda *given: score(0.5, 0.1))
    given = ("evaluate", *(f"--policy={name}" for name in ("student_unknown", "square", "student", "square")))
    (table,) = flexarm(*given).stdout.split("\n\n")[1:-1]
    assert ranked(table, ["student_unknown", "square", "student"])
    own, unknown = flexarm(*given, "--own").stdout.split("\n\n")[1:]
    assert own.startswith("Square-v0\n")
    assert ranked(own, ["square", "student"])
    assert unknown.startswith("SquareUnknown-v0\n")
    assert ranked(unknown, ["student_unknown"])


MODULE = """
import numpy as np

class Pulls:
    def predict(self, observation):
        return np.array([0.1, 0.0])

def pulls(observation):
    return 0.1, 0.0

class Reads:
    batched = True

    @classmethod
    def options(cls):
        return {"observation": ["joint_rates", "encoder_error"], "scaled": False, "frame": "world"}

    def predict(self, observation):
        assert np.shape(observation) == (4,)
        return np.array([0.1, 0.0])

one = Pulls()
"""


def test_evaluate_takes_policies_of_ones_own(flexarm: Shell) -> None:
    (flexarm.folder / "mine_here.py").write_text(MODULE)
    seeded = (*OUTPUT, "--seed", "5")
    flexarm("evaluate", "mine_here:Pulls", "mine_here:pulls", "mine_here:one", "mine_here:Reads", *ALONE, *seeded)
    found = flexarm.evaluation()["results"]
    assert len({one["laps"][0]["swing"]["duration"] for one in found}) == 1
    assert {one["environment"] for one in found} == {"FlexArm/Square-v0"}
    assert [one["laps"][0]["seed"] for one in found] == [5, 5, 5, 5]
    flexarm("evaluate", "mine_here:Reads", *ALONE, "--environment", "SquareUnknown-v0")


def test_laps_have_a_spread_in_which_an_early_end_counts(flexarm: Shell, monkeypatch: pytest.MonkeyPatch) -> None:
    """A policy that loses one plain lap of four."""
    plain = (0.1, None, 0.3, 0.2)
    laps = iter([score(0.5, rms) for rms in plain])
    monkeypatch.setattr("flexarm_agents.commands.evaluate.evaluate", lambda *given: next(laps))
    options = '{"randomisation": {"delay": [0.0, 0.06]}}'
    result = flexarm("evaluate", "square", *ALONE, "--laps", "4", "--seed", "0", "--options", options, *OUTPUT)
    (found,) = flexarm.evaluation()["results"]
    assert [(row["seed"], row["plain"]["rms"]) for row in found["laps"]] == list(enumerate(plain))
    assert {name: found["plain"]["rms"][name] for name in ("total", "complete", "best", "worst")} == {
        "total": 4, "complete": 3, "best": 0.1, "worst": None
    }  # fmt: skip
    assert found["swing"]["maximum"]["complete"] == 4
    assert " .. ended]" in result.stdout
    assert "4 complete" in result.stdout
    assert "1 of 4 ENDED: error" in result.stdout
    assert "both laps complete with 3 of 4 seeds" in result.stderr
    assert found["plant"] == {"randomisation": {"delay": [0.0, 0.06]}}


def test_seeds_of_one_setting_are_pooled_when_asked_for(flexarm: Shell) -> None:
    config = config_of(**{**CONFIG, "options": {}}).plain()
    size = 46
    for seed in (0, 1, 2):
        weights = [np.full((2, size), 0.01 * seed, np.float32)]
        notes = {"config": config | {"seed": seed}}
        NetworkPolicy(weights, [np.zeros(2, np.float32)], np.zeros(2, np.float32), "tanh", notes).save(
            Path(f"{seed}.npz")
        )
    assert "Trainings of one setting" not in flexarm("evaluate", "0.npz", "1.npz", *ALONE).stdout
    result = flexarm("evaluate", "0.npz", "1.npz", "2.npz", "square", *ALONE, *OUTPUT, "--pool")
    values = flexarm.evaluation()
    (setting,) = values["settings"]
    assert sorted(setting["trainings"]) == ["0.npz", "1.npz", "2.npz"]
    assert setting["swing"]["rms"] == setting["plain"]["maximum"] == {
        "total": 3, "complete": 0, "median": None, "interquartile_mean": None, "best": None, "worst": None
    }  # fmt: skip
    assert "(0 of 3 complete)" in result.stdout
    assert "square" not in result.stdout.split("Trainings of one setting")[1].splitlines()[2]


def test_models_of_stable_baselines_are_read_only_when_asked_for(flexarm: Shell) -> None:
    model = new_model(config_of(**{**CONFIG, "options": {}}))
    model.save("model.zip")
    result = flexarm("evaluate", "model.zip", *ALONE, status=1)
    assert result.stderr == "error: model.zip: needs --stable-baselines3 CLASS, since reading it can execute code\n"
    result = flexarm("evaluate", "model.zip", *ALONE, "--stable-baselines3", "PPO")
    assert "model.zip" in result.stdout
    for arguments, message in [
        (("--stable-baselines3", "SAC"), "error: model.zip: is no model of SAC ("),
        (("--stable-baselines3", "PPI"), "error: 'stable_baselines3:PPI': stable_baselines3 has no attribute PPI"),
        (("--stable-baselines3", "json:dumps"), "error: algorithm = 'json:dumps': must be a class of"),
        (
            ("--stable-baselines3", "PPO", "--environment", "SquareGain-v0"),
            "error: policy 'model.zip': was trained with observation of shape (46,), got (45,)",
        ),
    ]:
        result = flexarm("evaluate", "model.zip", *ALONE, *arguments, status=1)
        assert result.stderr.startswith(message)


def test_a_normalised_model_needs_its_statistics(flexarm: Shell) -> None:
    env = VecNormalize(DummyVecEnv([lambda: gymnasium.make("FlexArm/Square-v0")]))
    env.obs_rms.mean += 0.5
    model = new_model(config_of(**{**CONFIG, "options": {}}))
    model.save("model.zip")
    env.save("vecnormalize.pkl")
    given = ("evaluate", "--policy", "model.zip", "--stable-baselines3", "PPO", *OUTPUT)
    result = flexarm(*given, status=1)
    assert result.stderr.startswith("error: model.zip: vecnormalize.pkl lies beside it; ")
    for statistics in ("none", "vecnormalize.pkl"):
        flexarm(*given, "--vec-normalize", statistics)
    assert flexarm(*given, "--vec-normalize", "model.zip", status=1).stderr.startswith(
        "error: vec_normalize = 'model.zip': is "
    )
    policy = Entry("model.zip", algorithm="PPO", vec_normalize="vecnormalize.pkl").candidate().policy
    observation = np.full((2, 46), 0.5, np.float32)
    np.testing.assert_array_equal(
        policy.predict(observation)[0], model.predict(env.normalize_obs(observation), deterministic=True)[0]
    )

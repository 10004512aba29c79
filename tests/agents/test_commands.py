"""The command `flexarm`: its verbs, how it ends, and what it needs."""

import re
import subprocess
import sys
import time
from argparse import Namespace
from io import StringIO
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import gymnasium
import pytest

import flexarm_agents
import flexarm_env
from flexarm_agents import PPOConfig, shipped_policies
from flexarm_agents.commands import VERBS, progress, show, sources
from flexarm_agents.commands import train as training
from flexarm_agents.commands.arguments import EXAMPLES, STATUS
from flexarm_agents.commands.fields import read_fields
from flexarm_agents.commands.progress import episode_steps, progress_bar
from flexarm_agents.commands.text import columns, from_markdown
from flexarm_agents.environments import check_id, settings_of
from flexarm_agents.training.config import ALGORITHMS, config_class
from flexarm_baselines.registry import controller_names
from flexarm_env.envs.documentation import table
from flexarm_env.envs.registration import IDS
from flexarm_env.envs.settings import Settings
from flexarm_env.envs.single import FlexArmEnv
from flexarm_env.envs.termination import ENDS
from tests.support.shell import Shell


def test_help_has_every_verb_and_examples_and_fits_the_terminal(
    flexarm: Shell, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = flexarm("--help").stdout
    assert all(re.search(rf"^  {verb} ", out, re.MULTILINE) for verb in VERBS)
    assert "flexarm evaluate runs/mine" in out
    assert "exit status: 0 done; 1 error" in out
    for verb in VERBS:
        out = flexarm(verb, "--help").stdout
        for line in (*EXAMPLES[verb], STATUS):
            assert re.sub(r"\W+", "", line) in re.sub(r"\W+", "", out)  # a line may be broken, or in a frame
    assert flexarm("--version").stdout == f"flexarm {flexarm_env.__version__}\n"
    monkeypatch.setenv("COLUMNS", "70")
    description = flexarm("leaderboard", "--help").stdout.partition("\n\n")[2].partition("options:")[0]
    assert max(map(len, description.splitlines())) <= 70
    monkeypatch.setenv("COLUMNS", "2")
    assert "verbs:" in flexarm("--help").stdout


def test_an_interrupt_without_a_signal_ends_as_by_ctrl_c(monkeypatch: pytest.MonkeyPatch, flexarm: Shell) -> None:
    monkeypatch.setattr(show, "run", Mock(side_effect=KeyboardInterrupt))
    assert flexarm("show", "Square-v0", status=130).stderr == "\nstopped by SIGINT\n"


@pytest.mark.parametrize(("output", "code"), [("| head -c 1", 141), (">&-", 0), ("2>&-", 0)])
def test_nobody_reads_what_is_printed(output: str, code: int) -> None:
    """More is printed than a pipe takes while nobody reads."""
    program = (
        "from types import SimpleNamespace; from flexarm_agents import commands; "
        "commands._imported = lambda verb: SimpleNamespace(run=lambda arguments: print('line\\n' * 100_000)); "
        "commands.main(['list'])"
    )
    done = subprocess.run(
        ["bash", "-c", f'"$0" -c "$1" {output}; exit ${{PIPESTATUS[0]}}', sys.executable, program],
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stderr) == (code, "")


def test_what_is_not_installed_is_named_with_its_extra(monkeypatch: pytest.MonkeyPatch, flexarm: Shell) -> None:
    with monkeypatch.context() as patch:
        patch.setitem(sys.modules, "torch", None)
        for name in ("training.train", "commands.train"):
            patch.delitem(sys.modules, f"flexarm_agents.{name}", raising=False)
        err = flexarm("train", status=1).stderr
    assert err.startswith("error: flexarm train: torch is not installed; run `pip install ")
    monkeypatch.delitem(sys.modules, "flexarm_agents.sb3.vec_env", raising=False)
    monkeypatch.setitem(sys.modules, "stable_baselines3.common.vec_env.base_vec_env", None)
    with pytest.raises(ModuleNotFoundError, match=r"FlexArmVecEnv: stable_baselines3 is not installed; run"):
        flexarm_agents.FlexArmVecEnv  # noqa: B018


@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_without_arguments_a_training_is_the_tuned_one(algorithm: str) -> None:
    reader = training.parser(algorithm)
    kind = config_class(algorithm)
    assert read_fields(reader, kind, reader.parse_args(["--algorithm", algorithm])) == kind()


def test_arguments_are_read_as_their_fields_are() -> None:
    reader = training.parser()
    given = (
        "--hidden 64 32 --activation tanh --learning-rate 3e-4 --seed 7 --curriculum-steps None "
        "--initial-policy student --curriculum-options {}"
    )
    config = read_fields(reader, PPOConfig, reader.parse_args([*given.split(), "--options", '{"noise": 0.1}']))
    expected = {"hidden": (64, 32), "activation": "tanh", "learning_rate": 3e-4, "seed": 7, "initial_policy": "student"}
    assert config == PPOConfig(**expected, curriculum_options={}, options={"noise": 0.1})


@pytest.mark.parametrize(("verb", "algorithm"), [("teach", "dagger"), ("descend", "fopg")])
def test_old_verbs_are_their_algorithms(flexarm: Shell, verb: str, algorithm: str) -> None:
    err = flexarm(verb, "--rounds", "0", status=2).stderr
    assert err.startswith(f"flexarm {verb} is now `flexarm train --algorithm {algorithm}`;")
    assert "flexarm train: error: rounds = 0: must be an integer >= 1" in err


def test_list_shows_ids_and_policies(flexarm: Shell) -> None:
    out = flexarm("list").stdout
    assert all(f"FlexArm/{name} " in out for name in IDS)
    assert all(re.search(rf"^{name} ", out, re.MULTILINE) for name in (*shipped_policies(), *controller_names()))


@pytest.mark.parametrize("name", IDS)
def test_show_tells_all_that_is_declared(name: str) -> None:
    text = show.specification(f"FlexArm/{name}", 100)
    settings = Settings.of(IDS[name].options)
    for word in (*ENDS, *settings.observation, *IDS[name].options, "RESET OPTIONS", f'"flexarm_env:FlexArm/{name}"'):
        assert word in text
    assert "`" not in text
    assert not re.search(r"^\|", text, re.MULTILINE)
    assert max(map(len, text.splitlines())) <= 100


def test_ids_of_other_modules(flexarm: Shell) -> None:
    """The command finds them in the present folder, and writes what the module says."""
    register = """import gymnasium; gymnasium.register("Mine/Task-v0", "flexarm_env.envs.single:FlexArmEnv",
        max_episode_steps=700, kwargs={"reward": lambda infos: infos["time"], "side": 8.0})"""
    Path("own_task_of_a_test.py").write_text(f'"""Go round a small square.\n\nFor beginners."""\n{register}\n')
    out = flexarm("show", "own_task_of_a_test:Mine/Task-v0").stdout
    assert flexarm("show", "Reach-v0").stdout == flexarm("show", "flexarm_env:FlexArm/Reach-v0").stdout
    for words in ("Mine/Task-v0: Go round a small square.\n\nFor beginners.", "700 steps", "side    8.0", "<lambda>"):
        assert words in out
    assert "its module cannot be imported" in flexarm("show", "no_such_module:Mine/Task-v0", status=1).stderr
    assert settings_of(check_id("own_task_of_a_test:Mine/Task-v0"), {}).side == 8.0
    err = flexarm("train", "--environment", "own_task_of_a_test:Mine/Task-v0", "--folder", "new", status=1).stderr
    assert "give each of its functions a name in a module" in err  # at once, not at the first checkpoint
    assert not Path("new").exists()


def test_warm_up_passes_on_what_it_is_given(monkeypatch: pytest.MonkeyPatch, flexarm: Shell) -> None:
    calls: list[Any] = []

    def warm_up(ids: list[str], options: dict[str, Any], num_envs: list[int]) -> list[str]:
        calls.append((ids, options, num_envs))
        return [f"{one}, num_envs = {size}: compiled" for one in ids for size in num_envs]

    monkeypatch.setattr("flexarm_agents.commands.warm_up.warm_up", warm_up)
    given = ("warm-up", "Square-v0", "FlexArm/Reach-v0", "--options", '{"noise": 0.1}', "--num-envs", "1", "64")
    printed = flexarm(*given).stdout
    assert calls == [([f"FlexArm/{name}"], {"noise": 0.1}, [1, 64]) for name in ("Square-v0", "Reach-v0")]
    assert printed.splitlines()[-1] == "FlexArm/Reach-v0, num_envs = 64: compiled"
    flexarm("warm-up")
    assert [ids for ids, _, _ in calls[2:]] == [[f"FlexArm/{name}"] for name, one in IDS.items() if not one.extra]


def test_columns_stand_in_line() -> None:
    rows = [("name", "m", "end"), ("a", "10.5", "complete"), ("longer", "1", "")]
    assert columns(rows) == "name    m     end\na       10.5  complete\nlonger  1"
    assert columns(rows, right=True) == "name       m  end\na       10.5  complete\nlonger     1"


def test_markdown_becomes_text() -> None:
    assert from_markdown("See *one*:\n\n- a `b`\n- c d e\n\nEnd.", 6) == "See\none:\n\n- a b\n- c d\n  e\n\nEnd."
    rows = [("`a|b`", "word " * 9, ""), ("c", "", "")]
    page = f"See `code` and [a page](there.md).\n\n{table(('key', 'what', ''), rows)}"
    assert from_markdown(page, 40) == (
        "See code and a page.\n\nkey  what\na|b  word word word word word word word\n     word word\nc"
    )


def test_a_table_whose_text_has_no_room_becomes_a_list() -> None:
    page = table(("key", "unit", "what"), [("length", "metres", "of the path"), ("a", "", "b")])
    assert from_markdown(page, 40).startswith("key     unit    what\n")
    assert from_markdown(page, 20) == "length: unit metres\n    of the path\na:\n    b"
    numbers = table(("key", "what", "scale"), [("a longkey", "the length of the whole path", "2.5, 0.25, 0.25")])
    assert from_markdown(numbers, 30).startswith("key      what")


class Terminal(StringIO):
    def isatty(self) -> bool:
        return True


@pytest.mark.parametrize("kind", [Terminal, StringIO])
def test_a_bar_comes_when_it_takes_long_and_goes(kind: type[StringIO], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(progress, "PATIENCE" if kind is Terminal else "LOG", 0.02)
    errors = kind()
    monkeypatch.setattr("sys.stderr", errors)
    with progress_bar(8, "cells") as bar:
        bar.update()
        assert errors.getvalue() == ""
        time.sleep(0.15)
        bar.update(3)
        assert "4/8" in errors.getvalue()
    assert errors.getvalue().rpartition("\r")[0].rpartition("\r")[2].strip() == ""  # the last line is blank


def test_how_long_an_episode_is() -> None:
    assert episode_steps(gymnasium.make("FlexArm/Square-v0", max_episode_steps=70)) == 70
    assert episode_steps(FlexArmEnv(control_period=0.02, lap_time=8.0)) == 400


def test_a_controller_runs_where_it_is_made_for() -> None:
    given = Namespace(environment=None, stable_baselines3=None, vec_normalize="")
    homes = [sources.entry_of(name, given, {}).environment for name in ("lqg", "race_lqg")]
    given.environment = "Track-v0"
    homes.append(sources.entry_of("lqg", given, {}).environment)
    assert homes == ["FlexArm/Square-v0", "FlexArm/Race-v0", "FlexArm/Track-v0"]


def test_what_takes_long_is_said(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr(sources, "PATIENCE", 0.05)
    with sources._message_if_long("slow: the controller is designed"):
        assert capsys.readouterr().err == ""
        end = time.monotonic() + 10.0
        while not (said := capsys.readouterr().err) and time.monotonic() < end:
            time.sleep(0.05)
    assert said == "slow: the controller is designed\n"
    monkeypatch.setattr(sources, "PATIENCE", 60.0)
    with sources._message_if_long("quick: the controller is designed"):
        pass
    assert capsys.readouterr().err == ""

"""Programs that a signal stops while they import: they end as they do later, with a line and a status."""

import ast
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from tests.support.programs import ROOT

# Lies where programs look for numpy, which each imports before its work: the first second, made as long as it must be.
SLOW_LIBRARY = """
import os, signal, time
os.kill(os.getpid(), signal.{name})
time.sleep(60)
"""
PROGRAMS = {
    "the command": ("-c", "from flexarm_agents.commands import main; main(['list'])"),
    "a study": ("-m", "scripts.paper"),
    "a page": ("-m", "scripts.docs.environments"),
    "trainings": ("-m", "scripts.train", "--seeds", "0-3"),
}


@pytest.mark.skipif(os.name != "posix", reason="POSIX signals")
@pytest.mark.usefixtures("signals")
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("program", PROGRAMS.values(), ids=PROGRAMS)
def test_a_signal_while_importing_ends_with_one_line(
    program: tuple[str, ...], number: signal.Signals, tmp_path: Path
) -> None:
    (tmp_path / "numpy.py").write_text(SLOW_LIBRARY.format(name=number.name))
    ended = subprocess.run(
        [sys.executable, *program],
        cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": f"{tmp_path}{os.pathsep}{ROOT}"},
        capture_output=True,
        text=True,
        timeout=50,
        check=False,
    )
    assert (ended.returncode, ended.stdout, ended.stderr.strip()) == (128 + number, "", f"stopped by {number.name}")


def test_every_study_is_run_by_what_handles_its_end() -> None:
    for path in sorted((ROOT / "scripts").rglob("*.py")):
        for node in ast.parse(path.read_text(encoding="utf-8")).body:
            if isinstance(node, ast.If) and ast.unparse(node.test) == "__name__ == '__main__'":
                started = [one.value for one in ast.walk(node) if isinstance(one, ast.Expr)]
                names = {ast.unparse(call.func).split(".")[-1] for call in started if isinstance(call, ast.Call)}
                assert names == {"run"}, f"{path.relative_to(ROOT)}: {names}"

"""Jobs that failed: what is told of them, and what is kept."""

from __future__ import annotations

import pickle
from pathlib import Path

import pytest

from flexarm_agents.jobs.executors import _own_error, _run_share
from flexarm_agents.jobs.failures import LOG, Failure, check_failures
from tests.support.refusals import refuses


def fails(job: int) -> int:
    raise KeyError(job)


def raised(error: Exception, cause: Exception) -> Exception:
    try:
        raise error from cause
    except Exception as found:
        return found


def test_a_failure_says_of_what_kind_it_is() -> None:
    assert str(Failure("lqg", KeyError("gain"))) == "lqg: KeyError: 'gain'"
    assert str(Failure("lqg", AssertionError())) == "lqg: AssertionError: "
    assert "\n" not in str(Failure("lqg", ValueError("one\n  two")))


def test_each_failure_has_a_line_and_a_traceback(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = tmp_path / "results"
    one = raised(ValueError("bad"), OSError("inner"))
    failed = [Failure("lqg", one), Failure("lqg", ValueError("bad")), Failure("nmpc", KeyError("x"))]
    with refuses(OSError, "3 failed, see above", "the others are kept", f"tracebacks: {folder / LOG}"):
        check_failures(failed, folder, "the others are kept")
    assert capsys.readouterr().err == "lqg: ValueError: bad\nnmpc: KeyError: 'x'\n"
    log = (folder / LOG).read_text()
    assert log.count("lqg:\n") == 2
    assert all(text in log for text in ("OSError: inner", "in raised", "KeyError: 'x'"))
    check_failures([], folder, "the others are kept")
    assert list(folder.iterdir()) == []


def test_what_failed_in_a_worker_brings_its_traceback() -> None:
    (error,) = pickle.loads(pickle.dumps(_run_share(fails, [7])))
    assert type(error) is KeyError
    assert "in fails" in error.__notes__[0]


def test_an_error_of_ray_is_that_of_the_job() -> None:
    cause = KeyError(7)
    error = Exception("ray::f()\n  in fails\nKeyError: 7")
    error.cause = cause  # type: ignore[attr-defined]
    assert _own_error(error) is cause
    assert cause.__notes__ == [str(error)]
    lost = Exception("the node died")
    assert _own_error(lost) is lost

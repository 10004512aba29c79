"""Settings of the processes that run the tests, and of those that the tests start; with which kernels tests run."""

import gc
import os
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from _pytest.runner import runtestprotocol
from hypothesis import given, seed, settings
from hypothesis import strategies as st

# One thread for linear algebra: matrices here have a few hundred rows at most, and threads that wait for each other in
# every process cost far more than they save. Libraries read this when
# numpy is imported, which is after this file.
for variable in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(variable, "1")


# How long an example takes says how busy the machine is.
settings.register_profile("no deadline", deadline=None)
settings.register_profile("campaign", deadline=None)  # see `tests.hardening.strategies`
settings.load_profile("no deadline")


def _with_room() -> Callable[[Callable[[], object]], object]:
    """Make a function that makes a call from a frame of 512 KiB.

    CPython 3.11 keeps frames in chunks of 16 KiB. Where a kernel in plain Python happens to call from the end of
    a chunk, each of its calls maps and unmaps the next one, which can take most of a test's time. The frame gets a
    chunk of its own of twice its size, whose rest has room for all that a test calls.
    """
    found: dict[str, Any] = {}
    names = " = ".join(f"x{n}" for n in range(1 << 16))
    exec(f"def call(function):\n    return function()\n    {names} = None", found)
    made: Callable[[Callable[[], object]], object] = found["call"]
    return made


_call_with_room = _with_room()


@seed(0)
@settings(max_examples=1, database=None)
@given(st.none())
def _try_once(_: None) -> None:
    """Let hypothesis make its random numbers: it asks the garbage collector who holds them and warns if nobody does."""


def pytest_collection_finish() -> None:
    """Let the garbage collector leave what is there for the whole run, all modules and tests, and go round less often.

    It goes through millions of objects again and again, of which a test leaves hardly any.
    """
    _try_once()
    gc.collect()
    gc.freeze()  # from now on the collector does not say who holds these
    gc.set_threshold(20_000, 20, 20)


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_protocol(item: pytest.Item, nextitem: pytest.Item | None) -> bool:
    """Compile only kernels that tests share, for a test and the fixtures that it makes; see `support.plain`."""
    from tests.support.plain import compile_what_is_shared  # after the variables above are set

    item.ihook.pytest_runtest_logstart(nodeid=item.nodeid, location=item.location)
    with pytest.MonkeyPatch.context() as patch:
        if not any(any(item.iter_markers(name)) for name in ("slow", "compiled", "validation")):
            compile_what_is_shared(patch)
        _call_with_room(partial(runtestprotocol, item, nextitem=nextitem))
    item.ihook.pytest_runtest_logfinish(nodeid=item.nodeid, location=item.location)
    return True


@pytest.fixture
def uncompiled(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let the test's kernels run in plain Python."""
    from tests.support.plain import run_plainly  # after the variables above are set

    run_plainly(monkeypatch)


@pytest.fixture
def signals() -> Iterator[None]:
    """Let signals do what they usually do, also where the caller of the tests ignores them."""
    from tests.support.signals import heeded  # after the variables above are set

    with heeded():
        yield


@pytest.fixture
def flexarm(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path) -> Any:
    """Run the command `flexarm` in an empty folder; see `support.shell`."""
    from tests.support.shell import Shell  # after the variables above are set

    return Shell(monkeypatch, capsys, tmp_path)

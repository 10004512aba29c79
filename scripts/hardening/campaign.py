"""Fuzzing in blocks of cases: each block has a seed, a limit on the time of each case, and is counted when it is done.

A campaign that was interrupted goes on with the next block. A case that hangs ends the process with a traceback that
says where, whether it is in Python or in compiled code.
"""

from __future__ import annotations

import faulthandler
import time
import traceback
from collections import Counter
from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from typing import Any

import hypothesis
from hypothesis import HealthCheck, Phase
from hypothesis import strategies as st

LONGEST_FAULT = 4000  # characters kept of a fault's traceback


@dataclass(frozen=True)
class Part:
    """A kind of case.

    Attributes:
        text: what is tried, for the page.
        counted: what one count is, e.g. "option set".
        cases: makes the strategy of cases.
        check: tries a case and returns how often it came to which end, e.g. {"taken": 1}; any error is a fault.
        limit: time that a case may take before it counts as a hang [s].
        size: cases in a block.
    """

    text: str
    counted: str
    cases: Callable[[], st.SearchStrategy[Any]]
    check: Callable[[Any], Counter[str]]
    limit: float
    size: int


@dataclass
class Tally:
    """What came of a part so far.

    Attributes:
        blocks: blocks that are done.
        cases: cases that were tried.
        ends: how often each end was reached.
        longest: processor time of the slowest case [s].
        faults: tracebacks of faults, the smallest case of each block that has one.
    """

    blocks: int = 0
    cases: int = 0
    ends: Counter[str] = field(default_factory=Counter)
    longest: float = 0.0
    faults: list[str] = field(default_factory=list)

    @property
    def total(self) -> int:
        """How much was tried."""
        return self.ends.total()

    def plain(self) -> dict[str, Any]:
        """Return plain values."""
        return asdict(self) | {"ends": dict(self.ends)}

    @classmethod
    def of(cls, values: dict[str, Any]) -> Tally:
        """Read what `plain` gave."""
        return cls(**(values | {"ends": Counter(values["ends"])}))


def run_block(part: Part, seed: int, tally: Tally) -> None:
    """Try the cases of a block, and add them to a tally.

    Args:
        part: the kind of case.
        seed: of the block.
        tally: gets the counts, and the traceback of a fault.
    """

    def check(case: Any) -> None:
        """Try one case."""
        began = time.process_time()
        faulthandler.dump_traceback_later(part.limit, exit=True)
        try:
            ends = part.check(case)
        finally:
            faulthandler.cancel_dump_traceback_later()
        tally.longest = max(tally.longest, time.process_time() - began)
        tally.cases += 1
        tally.ends.update(ends)

    quiet = hypothesis.settings(
        max_examples=part.size,
        deadline=None,
        database=None,
        phases=(Phase.generate, Phase.shrink),
        suppress_health_check=list(HealthCheck),
        print_blob=False,
    )
    trial = hypothesis.seed(seed)(quiet(hypothesis.given(part.cases())(check)))
    try:
        trial()
    except Exception as error:
        notes = getattr(error, "__notes__", [])  # of hypothesis: the smallest case
        text = "".join(traceback.format_exception(error))[-LONGEST_FAULT:]
        tally.faults.append("\n".join([f"block {seed}", text, *notes]))
    tally.blocks += 1


def run_part(part: Part, seed: int, count: int, tally: Tally, tick: Callable[[int], Any]) -> None:
    """Try blocks until a part has its count.

    Args:
        part: the kind of case.
        seed: of the campaign; each block has its own.
        count: how much is to be tried in all.
        tally: what was tried before; it is brought up to date.
        tick: called after each block with what it added to the count.
    """
    while tally.total < count:
        before = tally.total
        run_block(part, seed * 1_000_000 + tally.blocks, tally)
        tick(tally.total - before)
        if tally.total == before:  # each further block would end at once, too
            break

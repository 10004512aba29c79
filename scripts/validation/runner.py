"""Runs groups of checks one by one, through files; draws from the files; reports."""

from __future__ import annotations

import ast
import hashlib
import platform
import time
import traceback
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from scripts.common.markdown import table
from scripts.common.result_files import write_json
from scripts.validation.checks import Check, Result, Settings, read, shown, write
from scripts.validation.groups import Group

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = tuple(ROOT / name for name in ("flexarm_env", "baselines", "agents"))
POLICIES = ROOT / "agents" / "policies"


@dataclass(frozen=True)
class Outcome:
    """What became of a group.

    Attributes:
        group: which.
        checks: what it checked; empty if it did not run to its end.
        quoted: further figures that the docs quote.
        tables: further tables of the docs, Markdown.
        seconds: what the work took (when it was done).
        reused: an earlier run's files were taken.
        missing: lines that say for lack of what it did not run.
        error: text of the exception that ended it; "" if none.
    """

    group: Group
    checks: Sequence[Check] = ()
    quoted: Mapping[str, float] = field(default_factory=dict)
    tables: Mapping[str, str] = field(default_factory=dict)
    seconds: float = 0.0
    reused: bool = False
    missing: Sequence[str] = field(default=())
    error: str = ""

    def failed(self, quick: bool) -> bool:
        """Whether it ends the run with an error; a package that lacks is no error in the quick run."""
        lacking = bool(self.missing) and not quick
        return lacking or bool(self.error) or not all(check.passed for check in self.checks)


def key(group: Group, quick: bool) -> str:
    """Collect what a group's result depends on: settings, the sources that it runs, and libraries below them."""
    digest = hashlib.sha256(repr((quick, platform.python_version())).encode())
    for package in ("numpy", "scipy", "numba", *group.needs):
        try:
            digest.update(f"{package} {version(package)}".encode())
        except PackageNotFoundError:
            digest.update(f"{package} missing".encode())
    packages = {path for folder in PACKAGES for path in folder.rglob("*.py")}
    policies = {path for path in POLICIES.rglob("*") if path.is_file()}
    for path in sorted(packages | policies | _imported(_file(group.module))):
        digest.update(path.name.encode() + path.read_bytes())
    return digest.hexdigest()


def _file(module: str) -> Path:
    """File of a module of this repository."""
    return ROOT / (module.replace(".", "/") + ".py")


def _imported(path: Path, known: frozenset[Path] = frozenset()) -> frozenset[Path]:
    """List a script's own file and all files of `scripts` that it imports, directly or not."""
    if path in known:
        return known
    known |= {path}
    for node in ast.walk(ast.parse(path.read_text())):
        names = []
        if isinstance(node, ast.ImportFrom) and node.module:
            names = [node.module, *(f"{node.module}.{alias.name}" for alias in node.names)]
        elif isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        for name in names:
            file = _file(name)
            if name.startswith("scripts.") and file.exists():
                known = _imported(file, known)
    return known


def run_group(group: Group, quick: bool, folder: Path, fresh: bool, progress: Callable[[str], None]) -> Outcome:
    """Run a group, or take its files if they are up to date; then draw.

    Args:
        group: which.
        quick: the short version.
        folder: folder of all results; the group's files go to a folder of its name, its pictures to ``figures``.
        fresh: run in any case.
        progress: called with a few words before each part of the work.
    """
    if missing := group.missing():
        return Outcome(group, missing=missing)
    here, wanted = folder / group.name, key(group, quick)
    try:
        earlier = None if fresh else read(here)
        reused = earlier is not None and earlier.key == wanted
        if not reused:
            start = time.perf_counter()
            findings = group.run(Settings(quick, progress))
            write(here, Result(wanted, time.perf_counter() - start, findings))
        result = read(here)  # what is reported and drawn is what lies in the files
        assert result is not None, f"{here}: the files just written cannot be read"
        progress("drawing")
        figures = folder / "figures"
        figures.mkdir(exist_ok=True)
        group.draw(result, figures)
        return _outcome(group, result, reused)
    except Exception:  # one group's error does not keep the others from running
        return Outcome(group, error=traceback.format_exc())


def earlier_outcome(group: Group, quick: bool, folder: Path) -> Outcome | None:
    """Read a folder of results, if it is up to date; nothing is run or drawn."""
    result = read(folder / group.name)
    return _outcome(group, result, reused=True) if result is not None and result.key == key(group, quick) else None


def _outcome(group: Group, result: Result, reused: bool) -> Outcome:
    found = result.findings
    return Outcome(group, found.checks, found.quoted, group.tables(found), result.seconds, reused)


# --- the report -----------------------------------------------------------------------------------------------


def summary(outcomes: Sequence[Outcome], quick: bool) -> dict[str, object]:
    """Return the content of summary.json."""
    return {
        "quick": quick,
        "passed": not any(outcome.failed(quick) for outcome in outcomes),
        "groups": {
            o.group.name: {
                "title": o.group.title,
                "seconds": o.seconds,
                "missing": list(o.missing),
                "error": o.error,
                "quoted": o.quoted,
                "tables": o.tables,
            }
            for o in outcomes
        },
        "checks": [asdict(check) | {"passed": check.passed} for o in outcomes for check in o.checks],
    }


def table_of_all(outcomes: Sequence[Outcome]) -> str:
    """Markdown: one row a group, with the checks that failed."""
    rows = []
    for outcome in outcomes:
        failed = [check.name for check in outcome.checks if not check.passed]
        verdict = f"**failed**: {'; '.join(failed)}" if failed else "passed"
        if outcome.missing:
            verdict = f"**not run**: {'; '.join(outcome.missing)}"
        if outcome.error:
            verdict = f"**error**: {outcome.error.splitlines()[-1]}"
        rows.append([outcome.group.title, str(len(outcome.checks)), verdict])
    return table(("group", "checks", "verdict"), rows)


def table_of_group(checks: Sequence[Check]) -> str:
    """Markdown: one row a check, with the reason of its threshold."""
    rows = [[c.name, c.found, c.threshold, c.reason, _verdict(c)] for c in checks]
    return table(("check", "figure", "threshold", "why this threshold", ""), rows)


def _verdict(check: Check) -> str:
    return "passed" if check.passed else "**failed**"


def printed(outcomes: Sequence[Outcome]) -> str:
    """For the terminal: every check with figure, threshold and reason, then what went wrong."""
    lines = []
    for outcome in outcomes:
        note = ", from an earlier run" if outcome.reused else ""
        lines += ["", f"{outcome.group.title} ({shown(outcome.seconds)} s{note})"]
        lines += [f"  NOT RUN: {line}" for line in outcome.missing]
        if outcome.error:
            lines += ["  ERROR:", *(f"    {line}" for line in outcome.error.splitlines())]
        for check in outcome.checks:
            verdict = "passed" if check.passed else "FAILED"
            lines += [f"  {verdict}  {check.name}: {check.found} (threshold {check.threshold})"]
            lines += [f"          because {check.reason}"]
    return "\n".join(lines)


def write_report(outcomes: Sequence[Outcome], quick: bool, folder: Path) -> None:
    """Write summary.json, summary.md and the tables of each group that ran."""
    write_json(folder / "summary.json", summary(outcomes, quick))
    (folder / "summary.md").write_text(table_of_all(outcomes))
    for outcome in outcomes:
        if outcome.checks:
            (folder / f"{outcome.group.name}.md").write_text(table_of_group(outcome.checks))
        for name, text in outcome.tables.items():
            (folder / f"{name}.md").write_text(text)

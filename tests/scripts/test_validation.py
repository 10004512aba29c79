"""`python -m scripts.validation`: its short version end to end, its machinery, and the page against its record."""

from __future__ import annotations

import json
import math
import re
import shutil
import sys
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from scripts.validation import __main__ as validate
from tests.support.programs import ROOT, refusal, run_here, run_study

DOCS = ROOT / "docs"
NAMES = (
    *("links", "arm", "engine", "cables", "two_engines", "plant", "controllers", "smooth", "drift", "orders", "steps"),
    "coriolis",
)
UNCHANGED = ("links", "orders", "coriolis")  # the same work in the short version
run_script = partial(run_study, "validation")


@pytest.fixture(scope="module")
def short(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """One short run of everything, which takes minutes: its folder and what it printed."""
    return short_run(tmp_path_factory.mktemp("validation") / "results")


@pytest.fixture(scope="module")
def links(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """Run one group, for the tests that are not slow."""
    return short_run(tmp_path_factory.mktemp("links") / "results", "--only", "links")


def short_run(output: Path, *options: str) -> tuple[Path, str]:
    done = run_script("--quick", "--output", output, *options)
    assert done.returncode == 0, done.stdout + done.stderr
    return output, done.stdout


def record() -> dict[str, Any]:
    """Of the run that made the committed page."""
    return json.loads((DOCS / "validation.json").read_text())


# --- end to end -----------------------------------------------------------------------------------------------


def assert_passed(run: tuple[Path, str], names: tuple[str, ...]) -> None:
    """All checks of some groups, each told with its reason; and their pictures, tables and data."""
    from scripts.validation.groups import GROUPS

    output, printed = run
    summary = json.loads((output / "summary.json").read_text())
    assert summary["passed"]
    assert summary["quick"]
    assert tuple(summary["groups"]) == names
    assert {check["group"] for check in summary["checks"]} == set(names)
    for check in summary["checks"]:
        assert check["passed"]
        assert check["name"] in printed
        assert f"because {check['reason']}" in printed
    assert "NOT RUN" not in printed
    for group in (group for group in GROUPS if group.name in names):
        assert group.drawings
        for name in group.drawings:
            for suffix in ("png", "svg"):
                assert (output / "figures" / f"{name}.{suffix}").stat().st_size > 5_000
        assert (output / f"{group.name}.md").read_text().startswith("| check |")
        assert (output / group.name / "result.json").exists()


def test_a_group_passes(links: tuple[Path, str]) -> None:
    assert_passed(links, ("links",))


@pytest.mark.slow
def test_the_short_version_passes(short: tuple[Path, str]) -> None:
    assert_passed(short, NAMES)


def test_what_is_up_to_date_is_not_run_again(links: tuple[Path, str], tmp_path: Path) -> None:
    output = tmp_path / "copy"
    shutil.copytree(links[0], output)
    again = ("--quick", "--output", output, "--only", "links")
    for options, taken_over in (((), True), (("--fresh",), False)):
        status, printed = run_here("validation.__main__", *again, *options)
        assert status == 0
        assert ("from an earlier run" in printed) == taken_over


# --- the machinery --------------------------------------------------------------------------------------------


def a_check(figure: float, **bounds: float) -> Any:
    from scripts.validation.checks import Check

    return Check("group", "name", figure, "reason", **(bounds or {"most": 1.0}))


def test_a_check_passes_within_its_bounds_only() -> None:
    assert a_check(0.5).passed
    assert a_check(1.0).passed
    assert not a_check(1.1).passed
    assert not a_check(math.nan).passed
    assert not a_check(-math.inf).passed
    assert a_check(3.0, least=2.0, most=4.0).passed
    assert not a_check(1.0, least=2.0).passed
    with pytest.raises(ValueError, match="bound"):
        a_check(1.0, least=None)  # type: ignore[arg-type]


def test_results_survive_the_file(tmp_path: Path) -> None:
    from scripts.validation.checks import Findings, Result, read, write

    checks = [a_check(0.5), a_check(math.nan)]
    findings = Findings(checks, {"x": np.arange(3.0)}, {"rows": [{"y": (1, 2)}]}, {"z": 1.0})
    write(tmp_path / "group", Result("key", 1.5, findings))
    found = read(tmp_path / "group")
    assert found is not None
    assert (found.key, found.seconds) == ("key", 1.5)
    assert found.findings.checks[0] == checks[0]
    assert not found.findings.checks[1].passed
    np.testing.assert_array_equal(found.findings.arrays["x"], np.arange(3.0))
    assert found.findings.records == {"rows": [{"y": [1, 2]}]}
    assert found.findings.quoted == {"z": 1.0}
    (tmp_path / "group" / "data.npz").write_bytes(b"half a file")
    assert read(tmp_path / "group") is None
    assert read(tmp_path / "nothing") is None


@dataclass(frozen=True)
class StubBase:
    """Stands for a `Group` with given behaviour."""

    name: str
    figure: float = 0.0
    needs: tuple[str, ...] = ()
    title: str = "A stub"
    module: str = "scripts.validation.checks"
    drawings: tuple[str, ...] = ()

    def run(self, settings: Any) -> Any:
        from scripts.validation.checks import Findings

        if math.isinf(self.figure):
            raise RuntimeError("an accident")
        return Findings([a_check(self.figure)])

    def draw(self, result: Any, folder: Path) -> None:
        assert folder.is_dir()

    def tables(self, findings: Any) -> dict[str, str]:
        return {}

    def missing(self) -> list[str]:
        return [f"no {package}" for package in self.needs]


@pytest.mark.parametrize(
    ("groups", "quick", "status", "says"),
    [
        ([StubBase("a"), StubBase("b")], False, 0, "all passed"),
        ([StubBase("a", 2.0), StubBase("b")], False, 1, "FAILED in a"),
        ([StubBase("a", math.nan), StubBase("b")], True, 1, "FAILED in a"),
        ([StubBase("a", math.inf), StubBase("b")], False, 1, "an accident"),
        ([StubBase("a", needs=("engine_x",)), StubBase("b")], False, 1, "NOT RUN: no engine_x"),
        ([StubBase("a", needs=("engine_x",)), StubBase("b")], True, 0, "NOT RUN: no engine_x"),
    ],
)
def test_one_group_does_not_stop_another(
    groups: list[StubBase],
    quick: bool,
    status: int,
    says: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr(validate, "GROUPS", groups)
    monkeypatch.setattr(validate, "NAMES", ("a", "b"))
    options = ["--output", str(tmp_path), "--only", "a", "b", *(["--quick"] if quick else [])]
    monkeypatch.setattr(sys, "argv", ["validate.py", *options])
    with pytest.raises(SystemExit) as caught:
        validate.main()
    assert caught.value.code == status
    printed = capsys.readouterr().out
    assert says in printed
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert summary["passed"] == (status == 0)
    assert summary["checks"][-1]["passed"], "the second group was not reached"


def test_the_key_knows_settings_and_sources() -> None:
    from scripts.validation.groups import GROUPS
    from scripts.validation.runner import _file, _imported, key

    keys = {key(group, quick) for group in GROUPS for quick in (True, False)}
    assert len(keys) == 2 * len(GROUPS)
    names = {path.name for path in _imported(_file("scripts.validation.two_links"))}
    assert {"two_links.py", "exact_beams.py", "finite_elements.py", "checks.py", "small_motion.py"} <= names
    assert "two_links_pictures.py" not in names


@pytest.mark.parametrize("where", ["PACKAGES", "POLICIES"])
def test_the_key_knows_files_in_subfolders(where: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from scripts.validation import runner
    from scripts.validation.groups import GROUPS

    nested = tmp_path / "folder" / "nested.py"
    nested.parent.mkdir()
    nested.write_text("x = 1")
    monkeypatch.setattr(runner, where, (tmp_path,) if where == "PACKAGES" else tmp_path)
    before = runner.key(GROUPS[0], True)
    nested.write_text("x = 2")
    assert runner.key(GROUPS[0], True) != before


def test_a_run_of_some_groups_keeps_the_others_in_the_summary(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(validate, "GROUPS", [StubBase("a"), StubBase("b")])
    monkeypatch.setattr(validate, "NAMES", ("a", "b"))

    def groups_after(*options: str) -> tuple[str, ...]:
        monkeypatch.setattr(sys, "argv", ["validation", "--quick", "--output", str(tmp_path), *options])
        with pytest.raises(SystemExit):
            validate.main()
        return tuple(json.loads((tmp_path / "summary.json").read_text())["groups"])

    assert groups_after("--only", "a", "b") == groups_after("--only", "a") == ("a", "b")
    (tmp_path / "b" / "result.json").unlink()
    assert groups_after("--only", "a") == ("a",)
    assert "left out: b" in capsys.readouterr().out


def test_the_short_version_has_a_folder_of_its_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(validate, "GROUPS", [StubBase("a")])
    monkeypatch.setattr(validate, "NAMES", ("a",))
    monkeypatch.chdir(tmp_path)
    for options, folder in (([], "validation"), (["--quick"], "validation-quick")):
        monkeypatch.setattr(sys, "argv", ["validation", "--only", "a", *options])
        with pytest.raises(SystemExit):
            validate.main()
        assert json.loads((tmp_path / "results" / folder / "summary.json").read_text())["quick"] == bool(options)


def test_bad_options_are_refused(tmp_path: Path) -> None:
    said = refusal("validation", "--only", "nothing", "--output", tmp_path / "x")
    assert "only = ('nothing',): must be one or more of" in said
    assert not (tmp_path / "x").exists()
    file = tmp_path / "file"
    file.write_text("kept")
    said = refusal("validation", "--only", "links", "--output", file / "folder")
    assert f"output = {file / 'folder'}: {file} is a file; must be a folder" in said
    assert file.read_text() == "kept"


# --- the page -------------------------------------------------------------------------------------------------


def test_the_page_shows_the_record() -> None:
    """`make docs` brings them up to date."""
    from scripts.docs.validation import tables_of
    from scripts.validation.groups import GROUPS

    found = record()
    assert found["passed"]
    assert not found["quick"]
    assert tuple(found["groups"]) == NAMES
    for group in GROUPS:
        for name in group.drawings:
            assert (DOCS / "figures" / "validation" / f"{name}.png").exists()
    page = (DOCS / "validation.md").read_text()
    pages = page + "".join((DOCS / name).read_text() for name in ("plant.md", "developers/validation_tables.md"))
    blocks = dict(re.findall(r"<!-- generated: (\w+) -->\n(.*?)<!-- end -->", pages, re.DOTALL))
    assert blocks == tables_of(found), "docs/validation.md is out of date: run `make docs`"
    for group in GROUPS:
        assert f"## {group.title}\n" in page
        assert f'make validate ARGS="--only {group.name}"' in page
        assert all(f"(figures/validation/{name}.png)" in page for name in group.drawings)


def assert_agrees_with_the_record(run: tuple[Path, str], names: tuple[str, ...]) -> None:
    """Where the short version does the same work: names, thresholds, and figures."""
    fresh, committed = (
        {(c["group"], c["name"]): c for c in summary["checks"]}
        for summary in (json.loads((run[0] / "summary.json").read_text()), record())
    )
    for key, check in fresh.items():
        if key[0] in UNCHANGED:
            old = committed[key]
            assert {k: check[k] for k in ("unit", "reason")} == {k: old[k] for k in ("unit", "reason")}
            for bound in ("least", "most"):  # one that is computed has its last digits from the machine's LAPACK
                assert check[bound] == (None if old[bound] is None else pytest.approx(old[bound], rel=1e-9)), key
            assert check["figure"] == pytest.approx(old["figure"], rel=0.02, abs=1e-10), key
    for group in names:
        assert {key for key in fresh if key[0] == group} & {key for key in committed if key[0] == group}


def test_the_record_of_a_group_agrees_with_a_new_run(links: tuple[Path, str]) -> None:
    assert_agrees_with_the_record(links, ("links",))


@pytest.mark.slow
def test_the_record_agrees_with_a_new_run(short: tuple[Path, str]) -> None:
    assert_agrees_with_the_record(short, NAMES)

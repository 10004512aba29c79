"""Workflows, forms and metadata: they can be read, name what exists, and agree with the package."""

import json
import re
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import Any

import pytest
import yaml

import flexarm_env
from tests.support.programs import ROOT

WORKFLOWS = sorted((ROOT / ".github/workflows").glob("*.yml"))
CHOOSER = ROOT / ".github/ISSUE_TEMPLATE/config.yml"
SCHEMAS = {
    "github-workflows": WORKFLOWS,
    "dependabot": [ROOT / ".github/dependabot.yml"],
    "github-issue-config": [CHOOSER],
    "github-issue-forms": sorted(set(CHOOSER.parent.glob("*.yml")) - {CHOOSER}),
    "citation-file-format": [ROOT / "CITATION.cff"],
}
PAGES = [ROOT / "SECURITY.md", ROOT / "CODE_OF_CONDUCT.md", ROOT / "CONTRIBUTING.md"]
VERBS = re.findall(r"^([a-z-]+):.*## ", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE)


def read(path: Path | str) -> Any:
    return yaml.safe_load((ROOT / path).read_text(encoding="utf-8"))


def label(path: Path) -> str:
    return path.name


@pytest.mark.parametrize("schema", SCHEMAS)
def test_files_are_as_their_readers_demand(schema: str) -> None:
    command = [sys.executable, "-m", "check_jsonschema", "--builtin-schema", f"vendor.{schema}", *SCHEMAS[schema]]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout


@pytest.mark.parametrize("path", WORKFLOWS, ids=label)
def test_workflows_are_limited(path: Path) -> None:
    """Each may only read by default, and each job ends."""
    workflow = read(path)
    assert workflow["permissions"] == {"contents": "read"}
    for name, job in workflow["jobs"].items():
        assert 0 < job["timeout-minutes"] < 360, name
        for action in (step["uses"] for step in job["steps"] if "uses" in step):
            assert re.fullmatch(r"[\w./-]+@[0-9a-f]{40}", action), f"{action}: a tag can be moved, a commit cannot"


@pytest.mark.parametrize("path", WORKFLOWS, ids=label)
def test_workflows_call_verbs_and_files_that_exist(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    verbs = re.findall(r"run: make ([\w-]+)", text)
    assert verbs
    assert set(verbs) <= set(VERBS)
    for file in re.findall(r"-c (\S+)", text):
        assert (ROOT / file).is_file()
    assert "secrets." not in text  # trusted publishing needs no token


def test_only_the_approved_job_may_publish() -> None:
    jobs = read(".github/workflows/release.yml")["jobs"]
    assert {name for name, job in jobs.items() if "id-token" in job.get("permissions", {})} == {"publish"}
    assert jobs["publish"]["environment"] == "pypi"
    assert jobs["publish"]["needs"] == "build"


@pytest.mark.parametrize("path", SCHEMAS["github-issue-forms"], ids=label)
def test_fields_of_a_form_have_names_of_their_own(path: Path) -> None:
    names = [field["id"] for field in read(path)["body"] if field["type"] != "markdown"]
    assert len(set(names)) == len(names)


def test_citation_archive_and_package_agree() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    citation, archive = read("CITATION.cff"), json.loads((ROOT / ".zenodo.json").read_text(encoding="utf-8"))
    assert citation["version"] == flexarm_env.__version__
    assert citation["title"] == archive["title"]
    assert citation["license"] == archive["license"] == project["license"]
    assert citation["keywords"] == archive["keywords"] == project["keywords"]
    assert [one["name"] for one in citation["authors"]] == [one["name"] for one in archive["creators"]]
    (paper,) = citation["references"]
    assert paper["title"] in archive["references"][0]
    assert str(paper["year"]) in archive["references"][0]
    page = re.sub("[{}]", "", (ROOT / "docs/reference/citing.md").read_text(encoding="utf-8"))
    for shown in (citation["version"], citation["title"], paper["title"], str(paper["year"])):
        assert f"= {shown}" in page


@pytest.mark.parametrize("page", PAGES, ids=label)
def test_links_of_pages_outside_docs_exist(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    for target in re.findall(r"\]\(([^)#:]+?)(?:#[^)]*)?\)", text):
        assert (page.parent / target).exists(), target
    for path in re.findall(r"`((?:tests|\.github)/[\w/.]+)`", text):
        assert (ROOT / path).exists(), path

"""Workflows, forms, metadata and requirements: they can be read, name what exists, and agree with the package."""

import json
import re
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import Any

import pytest
import yaml
from packaging.markers import default_environment
from packaging.requirements import Requirement
from packaging.version import Version

import flexarm_env
from tests.support.programs import PACKAGES, ROOT

WORKFLOWS = sorted((ROOT / ".github/workflows").glob("*.yml"))
CHOOSER = ROOT / ".github/ISSUE_TEMPLATE/config.yml"
SCHEMAS = {
    "github-workflows": WORKFLOWS,
    "dependabot": [ROOT / ".github/dependabot.yml"],
    "github-issue-config": [CHOOSER],
    "github-issue-forms": sorted(set(CHOOSER.parent.glob("*.yml")) - {CHOOSER}),
    "citation-file-format": [ROOT / "CITATION.cff"],
}
VERBS = re.findall(r"^([a-z-]+):.*## ", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE)


def read(path: Path | str) -> Any:
    return yaml.safe_load((ROOT / path).read_text(encoding="utf-8"))


@pytest.mark.parametrize("schema", SCHEMAS)
def test_files_are_as_their_readers_demand(schema: str) -> None:
    command = [sys.executable, "-m", "check_jsonschema", "--builtin-schema", f"vendor.{schema}", *SCHEMAS[schema]]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout


@pytest.mark.parametrize("path", WORKFLOWS, ids=lambda path: path.name)
def test_workflows_are_limited_and_call_what_exists(path: Path) -> None:
    """Each may only read by default, and each job ends."""
    workflow, text = read(path), path.read_text(encoding="utf-8")
    assert workflow["permissions"] == {"contents": "read"}
    for name, job in workflow["jobs"].items():
        assert 0 < job["timeout-minutes"] < 360, name
        for action in (step["uses"] for step in job["steps"] if "uses" in step):
            assert re.fullmatch(r"[\w./-]+@[0-9a-f]{40}", action), f"{action}: a tag can be moved, a commit cannot"
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


@pytest.mark.parametrize("path", SCHEMAS["github-issue-forms"], ids=lambda path: path.name)
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


DECLARED = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
PROJECT = DECLARED["project"]
EXTRAS: dict[str, list[Requirement]] = {
    "none": [Requirement(text) for text in PROJECT["dependencies"]],
    **{name: [Requirement(text) for text in texts] for name, texts in PROJECT["optional-dependencies"].items()},
}
PYTHONS = re.findall(r"Python :: (3\.\d+)", "\n".join(PROJECT["classifiers"]))


def others(extra: str) -> set[str]:
    """Return the names of the distributions of others that an extra brings itself."""
    return {one.name for one in EXTRAS[extra] if one.name != PROJECT["name"]}


def included(extra: str) -> set[str]:
    """Return the names of our other extras that an extra names."""
    return {name for one in EXTRAS[extra] if one.name == PROJECT["name"] for name in one.extras}


def reached(extra: str) -> set[str]:
    """Return the names of an extra and of all that it includes, by whichever way."""
    return {extra}.union(*(reached(name) for name in included(extra)))


def test_every_package_is_installed() -> None:
    """A folder that is not named here is missing in a wheel, though not in an editable install."""
    found = {
        ".".join((package, *path.parent.relative_to(folder).parts))
        for package, folder in PACKAGES.items()
        for path in folder.rglob("__init__.py")
    }
    assert found == set(DECLARED["tool"]["setuptools"]["packages"])


def test_the_lowest_versions_are_those_that_are_declared() -> None:
    declared = set()
    for requirement in (one for each in EXTRAS.values() for one in each if one.name != PROJECT["name"]):
        lowest = [one.version for one in requirement.specifier if one.operator == ">="]
        assert len(lowest) == 1, f"{requirement}: needs a lower bound"
        declared.add(f"{requirement.name}=={lowest[0]}")
    lines = (ROOT / "constraints-lowest.txt").read_text(encoding="utf-8").splitlines()
    assert [line for line in lines if not line.startswith("#")] == sorted(declared)


def locked(python: str) -> dict[str, Version]:
    """Return the versions of constraints.txt for a Python on Linux, by the packages' names."""
    lines = (ROOT / "constraints.txt").read_text(encoding="utf-8").splitlines()
    here = default_environment() | {
        "python_version": python,
        "python_full_version": f"{python}.5",
        "sys_platform": "linux",
    }
    found: dict[str, Version] = {}
    for one in (Requirement(line) for line in lines if not line.startswith("#")):
        if one.marker is None or one.marker.evaluate(here):
            assert one.name not in found
            found[one.name] = Version(str(one.specifier).removeprefix("=="))
    return found


@pytest.mark.parametrize("python", PYTHONS)
def test_what_make_installs_is_locked(python: str) -> None:
    """Each package that an extra of a verb names has one version for each Python, as the extra allows it."""
    versions = locked(python)
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    extras = {one for line in re.findall(r"^EXTRAS_\w+ *:= (.*)$", makefile, re.MULTILINE) for one in line.split(",")}
    for extra in {"none"}.union(*map(reached, extras)):
        for one in EXTRAS[extra]:
            assert one.name == PROJECT["name"] or versions[one.name] in one.specifier, f"{extra}: {one}"


def test_the_lock_names_the_release_of_torch_that_is_wanted() -> None:
    (wanted,) = DECLARED["tool"]["uv"]["constraint-dependencies"]
    assert f"\n{wanted}\n" in (ROOT / "constraints.txt").read_text(encoding="utf-8")


def test_the_page_says_what_each_extra_brings() -> None:
    """It does not list the tools of `test`, and of `dev` what this lacks."""
    page = (ROOT / "docs/install.md").read_text(encoding="utf-8")
    table = page.partition("| extra | brings |")[2].partition("\n\n")[0]
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in table.splitlines()[2:]]
    found = {row[0].strip("`"): set(re.findall(r"`([^`]+)`", row[1])) for row in rows}
    expected = {extra: others(extra) | included(extra) for extra in EXTRAS}
    assert found == expected | {"test": included("test"), "dev": EXTRAS.keys() - reached("dev") - {"none"}}
    assert others("dev") == set()


def test_pythons_are_the_same_everywhere() -> None:
    """The classifiers begin with the lowest version; the workflows test each of them."""
    assert PROJECT["requires-python"] == f">={PYTHONS[0]}"
    quoted = ", ".join(f'"{python}"' for python in PYTHONS)
    workflow = (ROOT / ".github/workflows/tests.yml").read_text(encoding="utf-8")
    assert workflow.count("python: [") == workflow.count(f"python: [{quoted}]") == 2


def test_paths_on_pages_outside_docs_exist() -> None:
    for page in ("SECURITY.md", "CODE_OF_CONDUCT.md", "CONTRIBUTING.md"):
        for path in re.findall(r"`((?:tests|\.github)/[\w/.]+)`", (ROOT / page).read_text(encoding="utf-8")):
            assert (ROOT / path).exists(), path

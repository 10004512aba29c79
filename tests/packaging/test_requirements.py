"""pyproject.toml names every package, and lowest versions and the table of extras agree with it."""

import re
import tomllib

import pytest
from packaging.markers import default_environment
from packaging.requirements import Requirement
from packaging.version import Version

from tests.support.programs import PACKAGES, ROOT

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


def listed() -> dict[str, str]:
    """Return the table of extras in docs/install.md: what each brings."""
    page = (ROOT / "docs/install.md").read_text(encoding="utf-8")
    table = page.partition("| extra | brings |")[2].partition("\n\n")[0]
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in table.splitlines()[2:]]
    return {row[0].strip("`"): row[1] for row in rows}


def test_the_page_says_what_each_extra_brings() -> None:
    """It does not list the tools of `test`, and of `dev` what this lacks."""
    found = {extra: set(re.findall(r"`([^`]+)`", text)) for extra, text in listed().items()}
    expected = {extra: others(extra) | included(extra) for extra in EXTRAS}
    assert found == expected | {"test": included("test"), "dev": EXTRAS.keys() - reached("dev") - {"none"}}
    assert others("dev") == set()


def test_pythons_are_the_same_everywhere() -> None:
    """The classifiers begin with the lowest version; the workflows test each of them."""
    assert PROJECT["requires-python"] == f">={PYTHONS[0]}"
    quoted = ", ".join(f'"{python}"' for python in PYTHONS)
    workflow = (ROOT / ".github/workflows/tests.yml").read_text(encoding="utf-8")
    assert workflow.count("python: [") == workflow.count(f"python: [{quoted}]") == 2

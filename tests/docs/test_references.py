"""What README, docs, docstrings and comments name in backquotes is in this tree: files, modules, functions."""

import ast
import builtins
import importlib.util
import keyword
import pkgutil
import re
from collections import defaultdict
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

from tests.support.programs import PACKAGES, ROOT
from tests.support.syntax import statements

FOLDERS = ("flexarm_env", "baselines", "agents", "scripts", "tests")
SOURCES = sorted(path for folder in FOLDERS for path in (ROOT / folder).rglob("*.py"))
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", ROOT / "SECURITY.md", *sorted((ROOT / "docs").rglob("*.md"))]
# What users, Gymnasium and MuJoCo call things.
OTHERS = {*["env", "envs", "run", "gym", "np", "gymnasium", "vector_kwargs", "implicitfast"]}
WRITTEN = {"json", "csv", "zip", "npz", "md"}  # files that our scripts write
OUR_PATHS = rf"\b(?:{'|'.join(FOLDERS)}|docs)/[\w/]+\.(?:py|md)\b"  # also outside backquotes
# A string with its prefix, a comment, or a word.
STRING = r"""(?:[bfr]{0,2}(?:(?s:"{3}.*?"{3})|"(?:\\.|[^"\\\n])*"|'(?:\\.|[^'\\\n])*'))"""
TOKEN = re.compile(rf"{STRING}|#.*|(?P<word>\w+)")
MADE = {"flexarm_env/unplaced/__init__.py"}  # by a test


@cache
def tokens(path: Path) -> tuple[set[str], list[tuple[int, str]]]:
    """Read a module once: its words, those of strings of plain words among them; comments and strings by lines."""
    words, written, text = {path.stem, path.parent.name}, [], path.read_text()
    for token in TOKEN.finditer(text):
        if token["word"]:
            words.add(token["word"])
        else:
            first = text.count("\n", 0, token.start()) + 1
            written += enumerate(token[0].splitlines(), first)
            if re.fullmatch(r"['\"]+[\w. ,]+['\"]+", token[0]):
                words.update(re.findall(r"\w+", token[0]))
    return words, written


@cache
def top_level(path: Path) -> set[str]:
    """Names that a module defines or imports at its top level, and below its classes."""
    found: set[str] = set()
    for node in statements(ast.parse(path.read_text())):
        match node:
            case ast.FunctionDef(name=name) | ast.ClassDef(name=name):
                found.add(name)
            case ast.Assign(targets=targets):
                found.update(each.id for target in targets for each in ast.walk(target) if isinstance(each, ast.Name))
            case ast.AnnAssign(target=ast.Name(id=name)):
                found.add(name)
            case ast.Import(names=names) | ast.ImportFrom(names=names):
                found.update(each.asname or each.name for each in names)
    if path.name == "__init__.py":
        found.update(each.stem for each in path.parent.iterdir())
    return found


@cache
def modules() -> dict[str, list[Path]]:
    """Collect the modules and packages of a name."""
    found: dict[str, list[Path]] = defaultdict(list)
    for path in SOURCES:
        found[path.parent.name if path.name == "__init__.py" else path.stem].append(path)
    return dict(found)


@cache
def vocabulary() -> set[str]:
    return set().union(*(tokens(path)[0] for path in SOURCES), dir(builtins), keyword.kwlist, OTHERS)


@cache
def files() -> set[str]:
    """Paths of our files, and their ends."""
    paths = [path.relative_to(ROOT).parts for folder in (*FOLDERS, "docs") for path in (ROOT / folder).rglob("*.*")]
    paths += [(path.name,) for path in ROOT.iterdir()]
    return {"/".join(parts[first:]) for parts in paths for first in range(len(parts))}


def wrong(reference: str, local: set[str]) -> bool:
    """Whether a reference looks like one of ours and leads nowhere; `local`: words of the source, none of a page."""
    if re.fullmatch(r"[\w/]+\.(py|toml)|[\w/]+/\w+\.md", reference):
        return reference not in files()
    if re.fullmatch(r"[a-z_]\w*", reference):
        return bool(local) and reference not in vocabulary()  # in a page it may be a symbol, or a name of others
    if not re.fullmatch(r"[a-z_]\w*(\.\w+)+", reference) or reference.rpartition(".")[2] in WRITTEN:
        return False
    head, *tail = reference.split(".")
    if head in ("scripts", "tests", *PACKAGES):
        return not leads_somewhere(reference)
    if any(tail[0] in top_level(path) for path in modules().get(head, ())):
        return False
    ours = head in local and head not in modules()
    return not (ours or head in OTHERS or _is_library(head))


def _is_library(name: str) -> bool:
    try:
        return importlib.util.find_spec(name) is not None
    except ValueError:  # it is being run
        return True


def leads_somewhere(reference: str) -> bool:
    try:
        pkgutil.resolve_name(reference)
    except (ImportError, AttributeError):
        return False
    return True


def texts(path: Path) -> Iterator[tuple[int, str]]:
    """Comments and docstrings of a module, or the lines of a page, with their line numbers."""
    if path.suffix == ".md":
        fenced = False
        for number, line in enumerate(path.read_text().splitlines(), 1):
            fenced ^= line.startswith("```")
            if not fenced:
                yield number, line
        return
    yield from tokens(path)[1]


@pytest.mark.parametrize("kind", ["sources", "pages"])
def test_references_lead_somewhere(kind: str) -> None:
    found = []
    for path in SOURCES if kind == "sources" else PAGES:
        local = tokens(path)[0] if path.suffix == ".py" else set()
        for number, text in texts(path):
            quoted = re.findall(r"(?<![`\w])`([\w./]+)(?:\(\))?`(?!`)", text)
            for reference in {*quoted, *re.findall(OUR_PATHS, text)} - MADE:
                if wrong(reference, local):
                    found.append(f"{path.relative_to(ROOT)}:{number}: `{reference}`")
    assert not found, "\n".join(found)


@pytest.mark.parametrize(
    ("reference", "is_wrong"),
    [
        ("dynamics.py", False),
        ("physics/dynamics.py", False),
        ("stepping.py", True),
        ("flexarm_env.envs.batch", False),
        ("flexarm_env.fleet", True),
        ("flexarm_env.metrics.no_such_function", True),
        ("layout.Row", False),
        ("layout.Column", True),
        ("no_such_module.f", True),
        ("numpy.float64", False),
        ("no_such_word_anywhere"[3:], True),
        ("sensor_delay", False),
    ],
)
def test_what_is_wrong(reference: str, is_wrong: bool) -> None:
    assert wrong(reference, {"self"}) is is_wrong

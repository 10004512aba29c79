"""The site's table of contents: chapters by what a reader wants, each a page that lists its pages.

The pages stay in the folders where they are: a chapter names them by patterns.
"""

import json
import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path, PurePosixPath
from typing import NamedTuple

KINDS = ("md", "ipynb")  # of pages
MODULES = (
    "flexarm_env",
    "flexarm_env.actions",
    "flexarm_env.analysis",
    "flexarm_env.formulas",
    "flexarm_env.metrics",
    "flexarm_env.parameters",
    "flexarm_env.reference_episode",
    "flexarm_env.identification",
    "flexarm_env.rollout",
    "flexarm_env.way_points",
    "flexarm_env.wrappers",
    "flexarm_env.envs.single",
    "flexarm_env.envs.vector",
    "flexarm_baselines",
    "flexarm_baselines.controller",
    "flexarm_baselines.observers",
    "flexarm_baselines.optimal",
    "flexarm_baselines.registry",
    "flexarm_agents",
)


class Chapter(NamedTuple):
    """A chapter of the site."""

    title: str  # as the sidebar shows it
    text: str  # what a reader finds there, in a sentence
    # By patterns, in their order, what each page answers; "" where its first sentence says it. A page that is not there
    # yet may be named
    pages: Mapping[str, str]


# By the names of the chapters' own pages, in the sidebar's order; what no pattern fits comes into the last one.
CHAPTERS: Mapping[str, Chapter] = {
    "start": Chapter(
        "Start",
        "Install FlexArm and learn its terms.",
        {
            "docs/install": "What to install, with sizes and times.",
            "docs/concepts": "The arm, its sensors, the laps and the scores: a drawing and a glossary.",
        },
    ),
    "tutorials": Chapter(
        "Tutorials",
        "Lessons of a few minutes each, to be read with a terminal beside them.",
        {
            "docs/tutorials/first_agent": "Train a policy by reinforcement learning and compare it with others.",
            "docs/tutorials/your_controller": "Write a controller in three steps and score it.",
            "docs/tutorials/late_sensor": "See what a late sensor costs, and use a filter that knows the delay.",
            "docs/tutorials/sampling": "Plan by sampling 1024 candidates from a state: CEM and MPPI.",
            "docs/tutorials/sim_to_chain": "Move a controller to an arm that its model does not contain.",
            "docs/tutorials/*": "",
            "docs/notebooks/control_engineers": "The arm as a plant: poles, zeros, margins, LQG.",
            "docs/notebooks/reinforcement_learning": "The arm as a learning problem: observations, rewards, scores.",
            "docs/notebooks/*": "",
        },
    ),
    "how_to": Chapter(
        "How-to guides",
        "Steps for a task that you have.",
        {
            "docs/training": "Train, resume and evaluate agents on the command line.",
            "docs/how_to/sensors": "Place, delay and noise of the sensors, and what a policy observes.",
            "docs/how_to/identify": "Parameters of an arm, and delays, from recordings, with intervals.",
            "docs/how_to/randomise": "Draw arm, sensors and task for each episode, and read what was drawn.",
            "docs/how_to/own_task": "A path, a reward and an id of your own.",
            "docs/how_to/planning": "Copy the state, roll candidates out, and use derivatives, with times.",
            "docs/how_to/batch": "Many arms at once: autoreset modes, threads, torch, arms that differ.",
            "docs/how_to/cluster": "Sweeps, trainings and the leaderboard on many cores and machines.",
            "docs/submit": "Add a controller or an agent to the leaderboard.",
            "docs/recipes/README": "Use FlexArm with Stable-Baselines3, CleanRL, TorchRL, RLlib, CasADi and others.",
            "docs/how_to/faq": "Questions, messages and symptoms, each with its answer.",
            "docs/how_to/*": "",
        },
    ),
    "reference": Chapter(
        "Reference",
        "Every environment, controller, score, function and version.",
        {
            "docs/environments/README": "All ids and their options, observations, actions and rewards.",
            "docs/how_to/published_arms": "Arms of laboratories and papers by name, with sources and assumptions.",
            "docs/controllers": "The controllers by name, and how to run them.",
            "docs/agents": "The trained policies that ship, and their scores.",
            "docs/metrics": "The figures that describe a run.",
            "docs/speed": "Steps a second, and ratios to programs that you may know.",
            "docs/leaderboard": "All controllers and agents on all tasks and disturbances.",
            "docs/replays": "Two controllers side by side on the same lap.",
            "api/index": "The public modules, from their docstrings.",
            "docs/reference/*": "",
            "docs/versioning": "What an id and a version promise.",
            "CHANGELOG": "What changed from version to version.",
        },
    ),
    "explanation": Chapter(
        "Explanation",
        "How the arm is modelled, why it is hard to control, and what each method achieves.",
        {
            "docs/model": "Coordinates, equations of motion, damping and integration.",
            "docs/analysis": "Why the joints are easy to control and the tip is not: poles, zeros, margins.",
            "docs/plant": "Why the default arm is as it is, and how far it is from a chain of rigid segments.",
            "docs/optimal": "The best known laps, and how they were found.",
            "docs/lqg": "A Kalman filter and a regulator along the best known lap.",
            "docs/predictive": "Nonlinear model predictive control at 100 Hz.",
            "docs/field_entries": "An IMU, a disturbance observer, H-infinity control, learning from lap to lap.",
            "docs/derivatives": "Derivatives of the dynamics, for planners and for other libraries.",
            "docs/learning/README": "What delay costs, what teaching is worth, what is lost on other arms.",
            "docs/reproduction": "Green & Sasiadek (2008) repeated: which of its claims hold.",
        },
    ),
    "developers": Chapter(
        "Developers",
        "How FlexArm is built, checked and released.",
        {
            "CONTRIBUTING": "Where things are, how a change is made, and which checks it must pass.",
            "docs/developers/reliability": "What is tried against the package, and how often.",
            "docs/developers/*": "",
            "docs/validation": "The physics against beams, finite elements and two other engines.",
            "SECURITY": "How to report a weakness.",
            "CODE_OF_CONDUCT": "How we treat each other.",
        },
    ),
}
# Pages below a page: the sidebar shows them when the page is opened.
PARTS: Mapping[str, Sequence[str]] = {
    "docs/environments/README": (
        *("docs/environments/options", "docs/environments/square", "docs/environments/square_*"),
        *("docs/environments/track", "docs/environments/reach", "docs/environments/paper", "docs/environments/*"),
    ),
    "docs/learning/README": tuple(
        f"docs/learning/{page}" for page in ("any_path", "late_sensor", "critic", "teaching", "gaps")
    ),
    "docs/recipes/README": ("docs/recipes/*",),
    "api/index": tuple(f"api/{name}" for name in MODULES),
}


def contents(pages: Iterable[str]) -> dict[str, list[str]]:
    """Return what of all pages, by their names without endings, stands below each chapter and each page with parts."""
    left = set(pages)
    found: dict[str, list[str]] = {}
    for parent, patterns in {**PARTS, **{name: chapter.pages for name, chapter in CHAPTERS.items()}}.items():
        found[parent] = []
        for pattern in patterns:
            matches = sorted(page for page in left - {parent} if PurePosixPath(page).match(pattern))
            found[parent] += matches
            left.difference_update(matches)
    found[list(CHAPTERS)[-1]] += sorted(left)
    return {parent: children for parent, children in found.items() if children}


def toctree(pages: Sequence[str], folder: Path) -> str:
    """Write a hidden table of contents, from which the sidebar is made; it has the ids of environments in short."""
    lines = []
    for page in pages:
        title = re.search(r"^# FlexArm/(.*)$", text_of(file_of(page, folder)), re.MULTILINE)
        lines.append(f"{title[1]} </{page}>" if title else f"/{page}")
    return "\n".join(("", "```{toctree}", ":hidden:", "", *lines, "```", ""))


def chapter_page(chapter: Chapter, pages: Sequence[str], folder: Path) -> str:
    """Write a chapter's page: a link to each of its pages, and what that answers."""
    lines = {}
    for page in pages:
        file = file_of(page, folder)
        lines[f"[]({file.relative_to(folder).as_posix()})"] = chapter.pages.get(page) or first_sentence(text_of(file))
    return listing(chapter.title, chapter.text, lines) + toctree(pages, folder)


def listing(title: str, text: str, lines: Mapping[str, str]) -> str:
    """Write a page that lists others."""
    return "\n".join((f"# {title}", "", text, "", *(f"{link}\n: {line}\n" for link, line in lines.items())))


def file_of(page: str, folder: Path) -> Path:
    """Return the file of a page by its name."""
    return next(file for kind in KINDS if (file := folder / f"{page}.{kind}").exists())


def text_of(page: Path) -> str:
    """Return the Markdown of a page, or of a notebook's first cell."""
    text = page.read_text(encoding="utf-8")
    return "".join(json.loads(text)["cells"][0]["source"]) if page.suffix == ".ipynb" else text


def first_sentence(text: str) -> str:
    """Return the first sentence of a page's text, without its links."""
    blocks = re.split(r"\n\s*\n", re.sub(r"<!--.*?-->|```.*?```", "", text, flags=re.DOTALL))
    prose = (block.strip() for block in blocks)
    first = next((block for block in prose if block and not re.match(r"[#<|!>]|[-*] ", block)), "")
    plain = re.sub(r" \(\[[^\]]*\]\([^)]*\)\)|\[([^\]]*)\]\([^)]*\)", r"\1", " ".join(first.split()))
    return re.split(r"(?<=[.!?])\s+(?=[\W\dA-Z])|:$", plain, maxsplit=1)[0]

"""Settings of the site that `make site` builds; `scripts/docs/site.py` lays out its pages."""

from __future__ import annotations

import os
import re
from html import escape
from pathlib import Path
from urllib.parse import urlsplit

from docutils import nodes
from docutils.utils.math import MathError
from docutils.utils.math.latex2mathml import tex2mathml
from sphinx.search.en import SearchEnglish
from sphinx.transforms.post_transforms import SphinxPostTransform
from sphinx.util import logging

from flexarm_env import __version__

project = "FlexArm"
author = "FlexArm contributors"
project_copyright = author
version = release = __version__

extensions = [
    "myst_nb",
    "notfound.extension",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
]
exclude_patterns = ["docs/_static", "docs/_templates"]
nb_merge_streams = True
nb_execution_mode = "off"  # notebooks are committed with their outputs; a test runs them
myst_heading_anchors = 4
myst_enable_extensions = ["deflist", "dollarmath"]
myst_fence_as_directive = ["math"]
suppress_warnings = ["myst.header"]  # sections of a page that a script writes may begin at a lower level

html_math_renderer = "mathml"  # which browsers draw by themselves; MathJax would come from the network
html_theme = "furo"
pygments_dark_style = "github-dark"  # furo's own underlines the names of modules like links
# Of the widgets, by light and in the dark; flexarm.css and flexarm.js use them.
COLOURS = {
    "fx-a": ("#0072b2", "#5cb8f2"),
    "fx-b": ("#d55e00", "#ff9d57"),
    "fx-b-text": ("#b04d00", "#ff9d57"),  # the same in letters, which need more contrast
    "fx-late": ("#8a3b8f", "#e29be6"),
    "fx-green": ("#007a59", "#45c9a0"),
    "fx-ochre": ("#8f6400", "#e6b450"),
    "fx-target": ("#1d2433", "#eef2f8"),
    "fx-path": ("#c3cad5", "#4a5465"),
    "fx-grid": ("#e4e8ee", "#2a303b"),
    "fx-text": ("#1d2433", "#e6ebf3"),
    "fx-soft": ("#5b6576", "#a3aec0"),
    "fx-panel": ("#f7f9fb", "#1a1e25"),
    "fx-line": ("#d9dfe7", "#343c49"),
    "fx-heat": ("#d55e00", "#ff8a3d"),
    "fx-lost": ("#6d7686", "#8b95a7"),
    "fx-accent": ("#0a5cc2", "#7db7ff"),
}
html_theme_options = {
    f"{scheme}_css_variables": {name: pair[n] for name, pair in COLOURS.items()}
    for n, scheme in enumerate(("light", "dark"))
}
html_title = f"FlexArm {release}"
html_copy_source = False
html_show_sphinx = False
html_domain_indices = False  # the Python API's own page lists the modules
html_favicon = "_static/favicon.svg"
html_search_scorer = str(Path(__file__).with_name("_static") / "scorer.js")
html_static_path = ["_static"]
templates_path = ["_templates"]
html_css_files = ["flexarm.css"]
html_js_files = ["flexarm.js"]
# Where the site will stand, e.g. "https://user.github.io/flexarm"; previews of links name their picture by it.
html_baseurl = os.environ.get("SITE_ADDRESS", "").rstrip("/")
# The page for wrong addresses is shown at any depth, so that its links begin where the site does.
notfound_urls_prefix = f"{urlsplit(html_baseurl).path}/"

add_module_names = False
autodoc_default_options = {"members": True, "show-inheritance": True}
autodoc_member_order = "bysource"
autodoc_typehints = "none"  # the signature has them
autodoc_typehints_format = "short"
# The site is built without them: what needs them is documented by its own text.
autodoc_mock_imports = ["mujoco", "pygame", "stable_baselines3", "tensorboard", "torch", "tqdm"]
default_role = "code"
napoleon_numpy_docstring = False
napoleon_use_ivar = True


# A table's cell with more characters may be broken into lines, and gets some width for that: flexarm.css.
LENGTHS = {"fx-pair": 8, "fx-long": 16, "fx-longer": 100, "fx-longest": 200}
LITERAL = r"(?<=::)\n\n(?:[ \t][^\n]*(?:\n|$)|\n)+"  # what is indented after a colon
EMPHASIS = r"(?<![\w*])\*[^\s*](?:[^*\n]|\n(?!\n))*?[^\s*]\*(?![\w*])"


def _as_plain_text(app, what, name, obj, options, lines) -> None:
    """Keep the signs of formulas outside backquotes, |x|, a * b and x_, which docstrings do not mean as markup.

    The specification of the environments is Markdown, and has pages of its own: of it the introduction is kept.
    """
    headings = [n for n, line in enumerate(lines) if line.startswith("## ")]
    if headings:
        lines[headings[0] :] = ["The pages of the environments have the whole specification."]
    if what in ("attribute", "property") and lines:
        lines[0] = f": {lines[0]}"  # Napoleon takes what stands before the first colon for a type
    for n, line in enumerate(lines[:-1]):
        if re.fullmatch(r"\s*(Returns|Yields):", line):  # here too
            lines[n + 1] = re.sub(r"^(\s*)", r"\1: ", lines[n + 1])
    text = re.sub(r"(?<=[^\s:]:)\n\n(?=[ \t])", ":\n\n", "\n".join(lines))
    parts = re.split(rf"({LITERAL}|`+[^`]+`+|{EMPHASIS})", text)
    parts[::2] = [re.sub(r"([|*])|(?<=\w)(_)(?!\w)", r"\\\1\2", part) for part in parts[::2]]
    lines[:] = "".join(parts).split("\n")


def _skip_numbered(app, what, name, obj, skip, options) -> bool:
    """Leave out a named tuple's fields one by one: its docstring has them."""
    return skip or type(obj).__name__ == "_tuplegetter"


def _formula(writer, node) -> None:
    """Write a formula as MathML."""
    block = isinstance(node, nodes.math_block)
    try:
        formula = tex2mathml(node.astext(), as_block=block).replace("<mo>'</mo>", '<mo lspace="0" rspace="0">′</mo>')
    except MathError as error:
        logging.getLogger(__name__).warning("formula %r: %s", node.astext(), error, location=node)
        formula = ""
    writer.body.append(f'<div class="formula">{formula}</div>' if block else formula)
    raise nodes.SkipNode


def _description(app, pagename, templatename, context, doctree) -> None:
    """Tell search engines and previews of links what a page is about: its first paragraph, cut after a sentence."""
    if not doctree:  # the index, search
        return
    title, text = (
        " ".join(next((one.astext() for one in doctree.findall(kind)), "").split())
        for kind in (nodes.title, nodes.paragraph)
    )
    if len(text) > 200:
        text = re.match(r".{0,160}[.!?](?=\s)|.{0,160}(?=\s)", text)[0]
    told = {"og:type": "website", "og:site_name": project, "og:title": title or project}
    if text:
        context["metatags"] += f'<meta name="description" content="{escape(text)}">\n'
        told["og:description"] = text
    if html_baseurl:
        told |= {"og:image": f"{html_baseurl}/_images/first_second.png", "twitter:card": "summary_large_image"}
        told["og:url"] = context["pageurl"]
    context["metatags"] += "".join(
        f'<meta property="{name}" content="{escape(value)}">\n' for name, value in told.items()
    )


class LongCells(SphinxPostTransform):
    """Marks the cells of tables that are long: the others are not broken into lines (flexarm.css)."""

    default_priority = 900

    def run(self, **kwargs) -> None:
        """Mark those of a page."""
        for row in (row for body in self.document.findall(nodes.tbody) for row in body.children):
            for cell in row.children:
                cell["classes"] += [name for name, least in LENGTHS.items() if len(cell.astext()) > least]


class Words(SearchEnglish):
    """Search finds a name of the code, physics_step or SquareUnknown, also by the words in it."""

    def split(self, text: str) -> list[str]:
        """Return the words of a text, then those in its names."""
        words = super().split(text)
        parts = (re.findall(r"[A-Z]?[a-z]+", word) for word in words)
        return words + [part for found in parts if len(found) > 1 for part in found]


def setup(app) -> None:
    """Register how formulas are written and words are found, marks of cells, and what Napoleon reads."""
    app.add_search_language(Words)
    app.add_post_transform(LongCells)
    app.connect("autodoc-process-docstring", _as_plain_text, priority=100)
    app.connect("autodoc-skip-member", _skip_numbered)
    app.connect("html-page-context", _description)
    app.add_html_math_renderer("mathml", (_formula, None), (_formula, None))

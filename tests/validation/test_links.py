"""Single links: clamped-free and pinned-free, bare and loaded, against the exact beam equation."""

from __future__ import annotations

from dataclasses import replace

import matplotlib.pyplot as plt
import numpy as np
import pytest
from matplotlib.axes import Axes
from numpy.typing import NDArray

from flexarm_env import ArmParameters, FlexibleArm
from scripts.common.plotting import COLOURS, SOFT, THRESHOLD, WIDTH, headline
from tests.validation import beams
from tests.validation.conftest import Page
from tests.validation.small_motion import BASES, COUNT, MODES, SHAPES, Case, frequencies, with_shapes

pytestmark = pytest.mark.validation

PAPER = ArmParameters.linear(damping_ratio=0.0)
# link 2 differs from the paper's, so that no length, rigidity or density can stand for another
OTHER = replace(PAPER, link_lengths=(4.5, 3.1), flexural_rigidities=(1676.0, 830.0), masses_per_length=(0.335, 0.21))
LOADED = replace(OTHER, elbow_hub_inertia=0.2, payload_mass=0.5, payload_inertia=0.1)
ARMS = {"paper's link": PAPER, "another link": OTHER, "loaded link": LOADED}
ROOTS = ("clamped", "pinned")
FLOOR = 1e-16  # an error of 0 is drawn here
LINES = ("-", "--", ":")

Cases = dict[tuple[str, str], Case]


@pytest.fixture(scope="module")
def cases() -> Cases:
    """Link 2 of an arm of which all else is held: its root turns with theta2, or nothing does."""
    found = {}
    for name, p in ARMS.items():
        for pinned in (False, True):
            link = beams.links(p)[1]
            structure = beams.single_link(link, pinned, p.elbow_hub_inertia, (p.payload_mass, p.payload_inertia))
            own = {(basis, m): _found(with_shapes(p, basis, m), pinned) for basis, m in SHAPES}
            found[name, ROOTS[pinned]] = Case(structure.frequencies(COUNT, int(pinned)), own)
    return found


def _found(arm: FlexibleArm, pinned: bool) -> NDArray[np.float64]:
    m = arm.parameters.modes_per_link
    link_2 = list(range(2 + m, 2 + 2 * m))
    return frequencies(arm, 0.0, [1, *link_2] if pinned else link_2, int(pinned))


def test_two_exact_methods_agree(page: Page) -> None:
    """The textbook's closed equations, and the dynamic stiffness that is used for loaded or joined links."""
    beam = beams.links(OTHER)[1]
    pairs = [
        (beams.clamped_free(beam, COUNT), beams.single_link(beam, False).frequencies(COUNT)),
        (beams.pinned_free(beam, COUNT), beams.single_link(beam, True).frequencies(COUNT, 1)),
    ]
    page.check(
        "two exact methods: characteristic equation, and dynamic stiffness",
        max(np.abs(a / b - 1.0).max() for a, b in pairs),
        "the same equation solved twice: rounding, magnified by bisection on a determinant's sign",
        most=1e-11,
    )


def test_clamped_free_links_are_exact(cases: Cases, page: Page) -> None:
    bare = [case for (name, root), case in cases.items() if root == "clamped" and name != "loaded link"]
    page.check(
        "clamped-free: all modes' frequencies, relative error",
        max(np.abs(case.errors("cantilever", m)).max() for case in bare for m in MODES),
        "the shapes are the exact ones, so that only rounding of roots and quadrature is left",
        most=1e-10,
    )


def test_two_modes_hold_a_pinned_link(cases: Cases, page: Page) -> None:
    bare = [case for (name, root), case in cases.items() if root == "pinned" and name != "loaded link"]
    page.check(
        "pinned-free: first frequency with 2 modes, relative error",
        max(case.errors("cantilever", 2)[0] for case in bare),
        "the claim of docs/model.md, 1 % for free joints with 2 modes, which is checked here",
        most=0.01,
    )


def test_frequencies_are_upper_bounds(cases: Cases, page: Page) -> None:
    page.check(
        "least error of any frequency, any link and number of modes",
        min(case.least_error for case in cases.values()),
        "Rayleigh and Ritz: a model of fewer shapes is stiffer, its frequencies are upper bounds (rounding 1e-10)",
        least=-1e-10,
    )


def test_frequencies_fall_with_each_mode(cases: Cases, page: Page) -> None:
    page.check(
        "largest growth of a frequency with one more mode",
        max(case.growth for case in cases.values()),
        "Rayleigh and Ritz: one more shape can only lower every frequency (rounding 1e-10)",
        most=1e-10,
    )


def test_picture(cases: Cases, page: Page) -> None:
    """The error of each frequency by number of modes."""
    figure, axes = plt.subplots(2, 2, figsize=(WIDTH, 6.8), sharex=True, sharey=True)
    for line, basis in zip(axes, BASES, strict=True):
        for axis, root in zip(line, ROOTS, strict=True):
            for name, style in zip(ARMS, LINES, strict=True):
                _draw(axis, cases[name, root], basis, style)
            axis.set(title=f"{root}-free, {basis} shapes", yscale="log", xticks=MODES)
        line[0].set_ylabel("relative error [1]")
        line[1].axhline(0.01, **THRESHOLD)
    for axis in axes[-1]:
        axis.set_xlabel("modes a link")
    for i, colour in enumerate(COLOURS[:COUNT]):
        axes[0, 0].plot([], [], "o", color=colour, label=f"frequency {i + 1}")
    for name, style in zip(ARMS, LINES, strict=True):
        axes[0, 0].plot([], [], linestyle=style, color=SOFT, label=name)
    figure.legend(loc="outside lower left", ncol=3)
    headline(figure, "A single link's frequencies against exact beams; dotted: threshold of the check")
    page.picture(figure, "links")


def _draw(axis: Axes, case: Case, basis: str, style: str) -> None:
    for i, colour in enumerate(COLOURS[:COUNT]):
        found = {m: np.maximum(np.abs(case.errors(basis, m)[i : i + 1]), FLOOR) for m in MODES}
        found = {m: errors for m, errors in found.items() if errors.size}
        axis.plot(list(found), list(found.values()), marker="o", linestyle=style, color=colour)

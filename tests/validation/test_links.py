"""Single links: clamped-free and pinned-free, bare and loaded, against the exact beam equation."""

from dataclasses import replace
from functools import cache
from itertools import product

import matplotlib.pyplot as plt
import numpy as np
import pytest

from flexarm_env import FlexibleArm
from scripts.common.plotting import COLOURS, SOFT, THRESHOLD, WIDTH
from tests.validation import beams, small_motion
from tests.validation.conftest import Check, Page, checked
from tests.validation.motion import Array
from tests.validation.small_motion import BASES, COUNT, MODES, SHAPES, Case, frequencies, with_shapes

pytestmark = pytest.mark.validation

OTHER = replace(small_motion.BARE, **small_motion.UNEQUAL)
LOADED = replace(OTHER, elbow_hub_inertia=0.2, **small_motion.PAYLOAD)
ARMS = {"paper's link": small_motion.BARE, "another link": OTHER, "loaded link": LOADED}
ROOTS = ("clamped", "pinned")
FLOOR = 1e-16  # an error of 0 is drawn here
LINES = ("-", "--", ":")


@cache
def cases() -> dict[tuple[str, str], Case]:
    """Link 2 of an arm of which all else is held: its root turns with theta2, or nothing does."""
    found = {}
    for name, p in ARMS.items():
        for pinned, root in enumerate(ROOTS):
            link = beams.links(p)[1]
            structure = beams.single_link(link, bool(pinned), p.elbow_hub_inertia, (p.payload_mass, p.payload_inertia))
            own = {(basis, m): _found(with_shapes(p, basis, m), pinned) for basis, m in SHAPES}
            found[name, root] = Case(structure.frequencies(COUNT, pinned), own)
    return found


def _found(arm: FlexibleArm, pinned: int) -> Array:
    m = arm.parameters.modes_per_link
    link_2 = list(range(2 + m, 2 + 2 * m))
    return frequencies(arm, 0.0, [1, *link_2] if pinned else link_2, pinned)


def two_exact_methods() -> float:
    """Compare the textbook's closed equations and the dynamic stiffness, which is used for loaded or joined links."""
    beam = beams.links(OTHER)[1]
    pairs = [
        (beams.clamped_free(beam, COUNT), beams.single_link(beam, False).frequencies(COUNT)),
        (beams.pinned_free(beam, COUNT), beams.single_link(beam, True).frequencies(COUNT, 1)),
    ]
    return max(np.abs(a / b - 1.0).max() for a, b in pairs)


def bare(root: str, modes: int) -> list[Array]:
    """Errors of the frequencies of the links without a load, in clamped-free shapes."""
    return [cases()[name, root].errors("cantilever", modes) for name in ARMS if name != "loaded link"]


test_checks = checked(
    Check(
        "two exact methods: characteristic equation, and dynamic stiffness",
        two_exact_methods,
        "the same equation solved twice: rounding, magnified by bisection on a determinant's sign",
        most=1e-11,
    ),
    Check(
        "clamped-free: all modes' frequencies, relative error",
        lambda: max(np.abs(errors).max() for m in MODES for errors in bare("clamped", m)),
        "the shapes are the exact ones, so that only rounding of roots and quadrature is left",
        most=1e-10,
    ),
    Check(
        "pinned-free: first frequency with 2 modes, relative error",
        lambda: max(errors[0] for errors in bare("pinned", 2)),
        "the claim of docs/validation.md, 1 % for free joints with 2 modes, which is checked here",
        most=0.01,
    ),
    *small_motion.rayleigh_and_ritz(
        "least error of any frequency, any link and number of modes", lambda: cases().values(), rounding="1e-10"
    ),
)


def test_picture(page: Page) -> None:
    figure, axes = plt.subplots(2, 2, figsize=(WIDTH, 6.8), sharex=True, sharey=True)
    for line, basis in zip(axes, BASES, strict=True):
        for axis, root in zip(line, ROOTS, strict=True):
            for (name, style), (i, colour) in product(zip(ARMS, LINES, strict=True), enumerate(COLOURS[:COUNT])):
                errors = {m: np.abs(cases()[name, root].errors(basis, m)[i : i + 1]) for m in MODES}
                found = {m: np.maximum(own, FLOOR) for m, own in errors.items() if own.size}
                axis.plot(list(found), list(found.values()), marker="o", linestyle=style, color=colour)
            axis.set(title=f"{root}-free, {basis} shapes", yscale="log", xticks=MODES)
        line[0].set_ylabel("relative error [1]")
        line[1].axhline(0.01, **THRESHOLD)
    plt.setp(axes[-1], xlabel="modes a link")
    for i, colour in enumerate(COLOURS[:COUNT]):
        axes[0, 0].plot([], [], "o", color=colour, label=f"frequency {i + 1}")
    for name, style in zip(ARMS, LINES, strict=True):
        axes[0, 0].plot([], [], linestyle=style, color=SOFT, label=name)
    figure.legend(loc="outside lower left", ncol=3)
    page.picture(figure, "links", "A single link's frequencies against exact beams; dotted: threshold of the check")

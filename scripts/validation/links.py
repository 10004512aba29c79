"""Single links: clamped-free and pinned-free, bare and loaded, against the exact beam equation."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from flexarm_env import ArmParameters, FlexibleArm
from scripts.validation.checks import Check, Findings, Settings
from scripts.validation.reference_models import exact_beams as exact
from scripts.validation.small_motion import BASES, MODES, frequencies, ritz_checks, with_modes

PAPER = ArmParameters(damping_ratio=0.0)
# link 2 differs from the paper's, so that no length, rigidity or density can stand for another
OTHER = replace(PAPER, link_lengths=(4.5, 3.1), flexural_rigidities=(1676.0, 830.0), masses_per_length=(0.335, 0.21))
LOADED = replace(OTHER, elbow_hub_inertia=0.2, payload_mass=0.5, payload_inertia=0.1)
ARMS = {"paper's link": PAPER, "another link": OTHER, "loaded link": LOADED}
COUNT = 4


def run(settings: Settings) -> Findings:
    """Every link and root, for every number of modes; the same in the quick run."""
    settings.progress("exact equations")
    rows = [_row(name, pinned) for name in ARMS for pinned in (False, True)]
    return Findings([*_oracle_checks(), *_checks(rows)], records={"rows": rows})


def _row(name: str, pinned: bool) -> dict[str, Any]:
    """Link 2 of an arm of which all else is held: its root turns with theta2, or nothing does."""
    p = ARMS[name]
    structure = exact.single_link(exact.links(p)[1], pinned, p.elbow_hub_inertia, (p.payload_mass, p.payload_inertia))
    row: dict[str, Any] = {"link": name, "root": "pinned" if pinned else "clamped"}
    row["exact"] = structure.frequencies(COUNT, int(pinned)).tolist()
    row["found"] = {basis: {str(m): _found(with_modes(p, basis, m), pinned).tolist() for m in MODES} for basis in BASES}
    return row


def _found(arm: FlexibleArm, pinned: bool) -> Any:
    m = arm.parameters.modes_per_link
    link_2 = list(range(2 + m, 2 + 2 * m))
    return frequencies(arm, 0.0, [1, *link_2] if pinned else link_2, int(pinned), COUNT)


def errors(row: dict[str, Any], basis: str, modes: int) -> Any:
    """Found over exact, minus 1. Shape (number of frequencies that the model has,)."""
    found = np.array(row["found"][basis][str(modes)])
    return found / np.array(row["exact"])[: len(found)] - 1.0


def _oracle_checks() -> list[Check]:
    """Compare the textbook's closed equations with the dynamic stiffness used for loaded or joined links."""
    beam = exact.links(OTHER)[1]
    pairs = [
        (exact.clamped_free(beam, COUNT), exact.single_link(beam, False).frequencies(COUNT)),
        (exact.pinned_free(beam, COUNT), exact.single_link(beam, True).frequencies(COUNT, 1)),
    ]
    apart = max(np.abs(a / b - 1.0).max() for a, b in pairs)
    return [
        Check(
            "links",
            "two exact methods: characteristic equation, and dynamic stiffness",
            apart,
            "the same equation solved twice: rounding, magnified by bisection on a determinant's sign",
            most=1e-11,
        )
    ]


def _checks(rows: list[dict[str, Any]]) -> list[Check]:
    bare = [r for r in rows if r["link"] != "loaded link"]
    clamped = [errors(r, "cantilever", m) for r in bare if r["root"] == "clamped" for m in MODES]
    pinned = [errors(r, "cantilever", 2)[0] for r in bare if r["root"] == "pinned"]
    every = [errors(r, basis, m) for r in rows for basis in BASES for m in MODES]
    return [
        Check(
            "links",
            "clamped-free: all modes' frequencies, relative error",
            np.abs(np.concatenate(clamped)).max(),
            "the shapes are the exact ones, so that only rounding of roots and quadrature is left",
            most=1e-10,
        ),
        Check(
            "links",
            "pinned-free: first frequency with 2 modes, relative error",
            max(pinned),
            "the claim of docs/model.md, 1 % for free joints with 2 modes, which is checked here",
            most=0.01,
        ),
        *ritz_checks(
            "links",
            "least error of any frequency, any link and number of modes",
            np.concatenate(every).min(),
            rows,
            rounding=1e-10,
        ),
    ]

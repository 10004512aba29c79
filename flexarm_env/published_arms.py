"""Arms with published numbers: fields of `ArmParameters`, in SI units, that `parameters.PRESETS` has by their names.

docs/how_to/published_arms.md has the source of each number, and what is derived or assumed; a test derives them again.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple


class Preset(NamedTuple):
    """An arm by its name.

    Attributes:
        text: description.
        fields: fields of `ArmParameters` that differ from their defaults.
    """

    text: str
    fields: Mapping[str, object]


_QUANSER: Mapping[str, object] = {
    "link_lengths": (0.202, 0.202),
    "flexural_rigidities": (2.690, 0.4614),
    "masses_per_length": (0.7597, 0.2659),
    "modes_per_link": 2,
    "shoulder_hub_inertia": 0.06354,
    "elbow_hub_inertia": 0.003020,
    "elbow_mass": 1.3673,
    "elbow_housing_inertia": 0.08086,
    "payload_mass": 0.157,
    "payload_inertia": 3.247e-5,
    "joint_friction": (4.0, 1.5),
    "mode_scale": 0.01,
}
PUBLISHED: Mapping[str, Preset] = {
    "quanser": Preset("Quanser 2-DOF serial flexible link, by the maker's data: two polynomials a link", _QUANSER),
    "quanser_measured": Preset(
        "the same, with stiffness, damping and friction fitted to a recording of a rig",
        {
            **_QUANSER,
            "flexural_rigidities": (3.861, 0.3077),
            "damping_ratio": 1.0,
            "joint_friction": (0.4336, 0.0811),
            "coulomb_friction": (3.710, 0.0999),
            "friction_smoothing": 0.05,
        },
    ),
    "de_luca_siciliano": Preset(
        "De Luca & Siciliano 1991: light links with a heavy elbow, no damping",
        {
            "link_lengths": (0.5, 0.5),
            "flexural_rigidities": (1.0, 1.0),
            "masses_per_length": (0.2, 0.2),
            "shoulder_hub_inertia": 0.1,
            "elbow_hub_inertia": 0.1,
            "elbow_mass": 1.0,
            "payload_mass": 0.1,
            "payload_inertia": 5e-4,
            "damping_ratio": 0.0,
            "mode_scale": 0.01,
        },
    ),
    "flexible_forearm": Preset(
        "De Luca et al. 1990: the laboratory arm of Rome, a rigid link with a flexible forearm of 0.7 m",
        {
            "link_lengths": (0.3, 0.7),
            "flexural_rigidities": (2000.0, 2.394),
            "masses_per_length": (31.16, 2.645),
            "modes_per_link": 4,
            "elbow_hub_inertia": 6.35e-4,
            "damping_ratio": 0.07,
            "damping_model": "modal",
            "mode_scale": 0.01,
        },
    ),
}

"""The mirror image of an environment, reflected about the world's x axis."""

from __future__ import annotations

from typing import Any

from flexarm_env.envs.settings import Settings

_OTHER = {"clockwise": "counterclockwise", "positive": "negative", "lower": "upper"}
_OTHER |= {second: first for first, second in _OTHER.items()}


def mirrored_options(options: dict[str, Any]) -> dict[str, Any]:
    """Return the options of the mirror image of an environment whose side and direction are not drawn."""
    settings = Settings.of(options)
    height, side = settings.start_corner.split()
    changed: dict[str, Any] = {"elbow_branch": _OTHER[settings.elbow_branch]}
    if settings.reference == ("waypoints",):
        return options | changed | {"waypoints": [(x, -y) for x, y in settings.waypoints or ()]}
    changed |= {"start_corner": f"{_OTHER[height]} {side}", "direction": _OTHER[settings.direction]}
    return options | changed

"""Who is on the board: the controllers by their names, shipped policies of the default arm, those whom a user adds."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

from flexarm_agents.board.rows import Row
from flexarm_agents.policies.load import load_policy, shipped_policies
from flexarm_baselines.registry import controller_names
from flexarm_env.validation import known_names, mapping

# The law acts on joints, which are not late, unless it is told to act on the late sensor, as in the paper.
_LATE = {"law_sensor": "sensor", "sensor": "rigid"}
LATE = (
    Row("ifdc", "ifdc_late", options=_LATE),
    Row("ifdc", "ifdc_late_rates", options={**_LATE, "delayed": "position+rate"}),
)
FIELDS = ("source", "name", "environment", "options", "algorithm", "vec_normalize")


def entries(added: Sequence[str]) -> list[Row]:
    """Return all rows.

    Args:
        added: sources of further rows, or names of JSON files with the fields of one.

    Raises:
        ValueError: if two have the same name, or a file is none of a row.
    """
    rows = [Row(name) for name in controller_names()] + list(LATE)
    rows += [Row(name, f"agent {name}") for name in shipped_policies() if not load_policy(name).has_own_arm]
    rows += [_added(source) for source in added]
    names = [row.name for row in rows]
    for name in names:
        if names.count(name) > 1:
            raise ValueError(f"rows: two have the name {name!r}; give one another name in its JSON file")
    return rows


def _added(source: str) -> Row:
    if not source.endswith(".json"):
        return Row(source)
    try:
        fields = mapping(source, json.loads(Path(source).read_text()))
        known_names(source, fields, FIELDS)
        return Row(**fields)
    except (TypeError, ValueError) as error:
        raise ValueError(f"{source}: no row ({error})") from error

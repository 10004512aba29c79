"""Stand-in until the registry of controllers has landed."""

from collections.abc import Mapping
from typing import Any, NamedTuple

from flexarm_baselines import FLSAC, IFDC


class Controller(NamedTuple):
    """An entry."""

    make: Any
    options: Mapping[str, Any]


CONTROLLERS = {
    "ifdc": Controller(IFDC.for_env, {"action_mode": "gain"}),
    "flsac": Controller(FLSAC.for_env, {"action_mode": "gain"}),
}

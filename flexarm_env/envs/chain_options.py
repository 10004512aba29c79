"""Options of the chain in MuJoCo that `FlexArm/SquareChain-v0` has for an arm; read without MuJoCo, too."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

from flexarm_env.allowed import Integer, Number, OneOf, check_fields, declared

Damping = Literal["stiffness", "modal", "two modes"]


@dataclass(frozen=True, kw_only=True)
class ChainOptions:
    """Options of the chain, beside those of the environment around it (`settings.Settings`)."""

    segments: int = declared(20, Integer(3, 100), text="rigid segments a link")
    chain_damping: Damping = declared(
        "stiffness",
        OneOf(get_args(Damping)),
        text='how the links are damped: "stiffness", in proportion to their springs, so that the ratio grows with the '
        'frequency; "modal", each mode that the segments have by the arm\'s ratio; "two modes", the first two so, the '
        "others 17.5 times as much",
    )
    chain_step: float = declared(
        5e-4,
        Number(1e-6, 1e-2, "s"),
        text="longest integration step of MuJoCo; it is shortened to divide `physics_step`, after which sensors are "
        "read, and where the chain would be unstable",
    )

    def __post_init__(self) -> None:
        """Validate."""
        check_fields(self)

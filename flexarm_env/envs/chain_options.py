"""Options of the chain in MuJoCo that `FlexArm/SquareChain-v0` has for an arm; read without MuJoCo, too."""

from __future__ import annotations

from dataclasses import dataclass

from flexarm_env.allowed import Integer, Number, check_fields, declared


@dataclass(frozen=True, kw_only=True)
class ChainOptions:
    """Options of the chain, beside those of the environment around it (`settings.Settings`)."""

    segments: int = declared(20, Integer(3, 100), text="rigid segments a link")
    chain_step: float = declared(
        5e-4,
        Number(1e-6, 1e-2, "s"),
        text="longest integration step of MuJoCo; it is shortened to divide `physics_step`, after which sensors are "
        "read, and where the chain would be unstable",
    )

    def __post_init__(self) -> None:
        """Validate."""
        check_fields(self)

"""The arm's models that are compared: kinematics, shapes and their number."""

from __future__ import annotations

from typing import Any, NamedTuple

from flexarm_env.parameters import MAX_MODES, Kinematics, ModeShapes


class Model(NamedTuple):
    """Fields of `ArmParameters` that make a model."""

    kinematics: Kinematics
    mode_shapes: ModeShapes
    modes_per_link: int

    @property
    def label(self) -> str:
        """For tables and pictures."""
        shape = "mode" if self.mode_shapes == "cantilever" else "polynomial"
        return f"{self.kinematics}, {self.modes_per_link} {shape}{'s' if self.modes_per_link > 1 else ''}"

    @property
    def fields(self) -> dict[str, Any]:
        """For `ArmParameters`."""
        return self._asdict()


MODELS = tuple(
    Model(kinematics, shapes, modes)
    for kinematics in ("linear", "foreshortened")
    for shapes in ("cantilever", "polynomial")
    for modes in range(1 if shapes == "cantilever" else 3, MAX_MODES + 1)  # fewer polynomials are no use, see "arm"
)


def model(kinematics: Kinematics, modes: int, shapes: ModeShapes = "cantilever") -> Model:
    """Make a model by its usual names."""
    return Model(kinematics, shapes, modes)


DEFAULT = model("foreshortened", 3, "polynomial")  # the default arm's

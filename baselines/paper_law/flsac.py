"""Fuzzy logic system adaptive control, FLSAC: the law's gain is inferred from the links' deflections.

    delta_i = tip deflection of link i / 0.2 m
    lambda = K_s * fuzzy(clip(K_n delta_1), clip(K_n delta_2))        (14)

In the paper's model (one mode a link, A = 0.1, so phi(L) = 2 A = 0.2 m) delta_i is the modal coordinate; as
tip deflection it means the same for any number of modes and any A. Nothing delays the deflections.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from numbers import Integral
from typing import Any, Literal

import numpy as np

from flexarm_baselines.arrays import Floats
from flexarm_baselines.paper_law.fuzzy import PAPER_GAIN_RANGE, MamdaniSystem, paper_system
from flexarm_baselines.policy import GainPolicy, env_attribute, env_gain_limit
from flexarm_env.validation import choice, finite_array, finite_values, number, shown

REFERENCE_DEFLECTION = 0.2
"""Tip deflection [m] that counts as delta = 1: the tip value 2 A of the paper's mode shape (4)."""


@dataclass(frozen=True, eq=False)
class FLSAC(GainPolicy):
    """The paper's fuzzy gain.

    Attributes:
        modal_slice: where an observation holds the 2 m modal coordinates, link 1's before link 2's, as
            ``slice(start, stop)`` without step.
        tip_weights: tip deflection per unit of each modal coordinate as it is observed [m]: phi_j(L), times the
            coordinate's scale where observations are scaled; shape ``(m,)`` for two equal links or ``(2, m)``. Kept
            as ``(2, m)``.
        K_n: normalising factor on delta, positive, dimensionless.
        K_s: scale, dimensionless; positive, above 0.5 as width scale.
        scale: what K_s scales: "output" the inferred gain (14), or "width" the input sets' base widths.
        gain_limit: gain that the action 1 stands for in the environment, dimensionless.

    Raises:
        ValueError: a value is not finite or out of range, the slice does not hold 2 m coordinates, K_s as
            output scale leads past the gain limit, or K_s as width scale leaves gaps between the sets.
    """

    modal_slice: slice = field(repr=False)
    tip_weights: Floats = field(repr=False)
    K_n: float = 5.0
    K_s: float = 1.0
    scale: Literal["output", "width"] = "output"
    gain_limit: float = 1.0
    system: MamdaniSystem = field(init=False, repr=False)

    def __post_init__(self) -> None:
        choice("scale", self.scale, ("output", "width"))
        number("K_n", self.K_n, above=0.0)
        number("K_s", self.K_s, above=0.5 if self.scale == "width" else 0.0)  # 0.5: see paper_system
        number("gain_limit", self.gain_limit, above=0.0)
        weights = finite_values("tip_weights", self.tip_weights)
        weights = finite_array("tip_weights", [weights, weights] if weights.ndim == 1 else weights, (2, None))
        _check_modal_slice(self.modal_slice, weights.size)
        largest = self._output_scale * PAPER_GAIN_RANGE[1]
        if largest > self.gain_limit * (1.0 + 1e-12):  # rounding must not refuse K_s = 6/5 at gain_limit = 1
            raise ValueError(
                f"K_s = {self.K_s!r}: with scale = {self.scale!r} the gain reaches {largest:g}, "
                f"but must stay within gain_limit = {self.gain_limit!r}"
            )
        object.__setattr__(self, "tip_weights", weights)
        object.__setattr__(self, "system", paper_system(self.K_s if self.scale == "width" else 1.0))

    @classmethod
    def options(cls) -> dict[str, Any]:
        """Return the options with which an environment's action is the gain, and the deflections are observed."""
        return super().options() | {"observation": ("modal_coordinates",), "last_actions": 1}

    @classmethod
    def for_env(cls, env: Any, **options: Any) -> FLSAC:
        """Make the fuzzy gain for an environment, single or vector, with its modes, scales and gain limit.

        Args:
            env: a FlexArm environment whose action is the gain and whose observation holds the modal
                coordinates. Wrappers around it must leave observation and action as they are.
            **options: K_n, K_s, scale.

        Raises:
            ValueError: its action is not one gain, its observation lacks the modal coordinates, or an option
                does not fit (see the class).
        """
        blocks = env_attribute(env, "observation_blocks")
        if "modal_coordinates" not in blocks:
            raise ValueError(f"env must observe 'modal_coordinates', its observation holds {sorted(blocks)}")
        scale = np.asarray(env_attribute(env, "observation_scale"))[blocks["modal_coordinates"]]
        weights = np.stack([link.tip_values for link in env_attribute(env, "arm").modes]) * scale.reshape(2, -1)
        limit = env_gain_limit(env)
        return cls(modal_slice=blocks["modal_coordinates"], tip_weights=weights, gain_limit=limit, **options)

    def deflections(self, observations: Floats) -> Floats:
        """Return the normalised tip deflections delta, before K_n.

        Args:
            observations: shape ``(n, k)``.

        Returns:
            delta_1, delta_2, dimensionless, shape ``(n, 2)``.
        """
        if observations.shape[1] < self.modal_slice.stop:
            raise ValueError(
                f"observation must hold at least {self.modal_slice.stop} values, got {observations.shape[1]}"
            )
        modal = observations[:, self.modal_slice].reshape(-1, *self.tip_weights.shape)
        return np.asarray((modal * self.tip_weights).sum(axis=2) / REFERENCE_DEFLECTION)

    def gains(self, observations: Floats) -> Floats:
        """Infer the gains; see `GainPolicy.gains`."""
        inferred = self.system.evaluate(self.K_n * self.deflections(observations))
        # K_s may put the largest centroid exactly at the limit: rounding must not carry it past.
        return np.minimum(self._output_scale * inferred, self.gain_limit)

    @property
    def _output_scale(self) -> float:
        return self.K_s if self.scale == "output" else 1.0


def _check_modal_slice(modal_slice: object, coordinates: int) -> None:
    """Refuse anything but slice(start, stop) over ``coordinates`` entries, of which there must be some."""
    if not isinstance(modal_slice, slice):
        raise TypeError(f"modal_slice = {shown(modal_slice)}: must be a slice")
    start, stop, step = modal_slice.start, modal_slice.stop, modal_slice.step
    integers = isinstance(start, Integral) and isinstance(stop, Integral)
    plain = integers and start >= 0 and step in (None, 1)
    if not plain or coordinates == 0 or stop - start != coordinates:
        raise ValueError(
            f"modal_slice = {shown(modal_slice)}: must be slice(start, stop) with start >= 0 and stop - start = "
            f"{coordinates}, the number of tip_weights of both links, which must be > 0"
        )

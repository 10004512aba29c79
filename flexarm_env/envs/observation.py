"""Observations: vector, bounds and documentation follow from the declarations of their blocks."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flexarm_env.codegen.declarations import Program
from flexarm_env.envs.blocks import BLOCKS, ENCODERS, INFORMATION
from flexarm_env.envs.bounds import reach_of
from flexarm_env.envs.choices import REACH
from flexarm_env.envs.corners import worst
from flexarm_env.envs.sensors import LINK_2
from flexarm_env.envs.settings import Settings
from flexarm_env.kernels.variants import Variant, shared_model
from flexarm_env.validation import choice

Array = NDArray[np.float64]


def readings_of(settings: Settings) -> tuple[str, ...]:
    """Return what a policy can learn of the arm and its task by an environment's observation and action.

    Laws that act under the action read too, and the link's frame turns with the encoder of theta1.

    Returns:
        Names in `INFORMATION`, in its order.
    """
    found = {BLOCKS[choice("observation", name, BLOCKS)].reads for name in settings.observation}
    law = settings.mode.law
    if law == "joints" or settings.frame == "link" or (law == "tip" and settings.feedback_source == "joints"):
        found.add(ENCODERS)
    if law == "tip" and settings.feedback_source == "sensor":
        found.add(LINK_2.reads)
    return tuple(name for name in INFORMATION if name in found)


def variant_of(settings: Settings, program: Program, lanes: int = 1, disturbed: bool = False) -> Variant:
    """Return the variant of the kernels that step an environment; see `Variant`."""
    arm = settings.flexible_arm
    return Variant(
        program,
        modes=arm.parameters.modes_per_link,
        complete=arm.parameters.velocity_forces == "complete",
        lanes=lanes,
        sensor=shared_model(settings.sensor),
        rate_jacobian=settings.rate_jacobian,
        law_on_sensor=settings.feedback_source == "sensor",
        own_paths=settings.reference == ("moves",),
        foreshortened=arm.constants.foreshortened,
        disturbed=disturbed,
        sensors=tuple((one.sensor.quantity, one.link) for one in settings.further_sensors),
        dry=settings.dry_joints,
        motors=settings.real_motors,
        payloads=len(settings.payload_changes or ()),
        pulses=settings.pulsed,
        drifting=settings.drifting,
    )


class ObservationLayout(NamedTuple):
    """Layout of an observation.

    Attributes:
        blocks: slice of each block.
        rows: row of the arena of each number. Shape (k,).
        scale: divisor of each number. Shape (k,).
        bound: largest magnitude of each number. Shape (k,), float32.
        mirror: sign of each number in the mirrored episode. Shape (k,), float32.
    """

    blocks: dict[str, slice]
    rows: NDArray[np.int64]
    scale: Array
    bound: NDArray[np.float32]
    mirror: NDArray[np.float32]


def common_layout(kinds: Sequence[Settings], program: Program) -> ObservationLayout:
    """Lay out the observations of a batch (`observation_layout`), with the widest bounds of its environments."""

    def widest(settings: Settings) -> float:
        return float(observation_layout(settings, program).bound.sum())

    layouts = [observation_layout(settings, program) for settings in kinds]
    first = layouts[0]
    assert all(np.array_equal(one.scale, first.scale) for one in layouts)
    corners = [corner for one in kinds if (corner := worst(one, widest)) is not one]
    # what is drawn may change a scale; observations keep that of the settings
    layouts += [observation_layout(corner, program) for corner in corners]
    bounds = [one.scale / first.scale * one.bound for one in layouts]
    return first._replace(bound=np.maximum.reduce(bounds).astype(np.float32))


def observation_layout(settings: Settings, program: Program) -> ObservationLayout:
    """Lay out the observation that an environment's settings select.

    Raises:
        ValueError: for an unknown block, or one that the action mode does not have.
    """
    places = variant_of(settings, program).rows
    reach = reach_of(settings)
    blocks: dict[str, slice] = {}
    rows: list[int] = []
    scale: list[float] = []
    bound: list[float] = []
    mirror: list[int] = []
    for name in settings.observation:
        block = BLOCKS[choice("observation", name, BLOCKS)]
        if settings.action_mode not in block.modes:
            raise ValueError(
                f"observation: there is no block {name!r} with action_mode = {settings.action_mode!r}; "
                f"only with {' or '.join(map(repr, block.modes))}"
            )
        part, first, count = block.rows(settings)
        limits = block.limits(settings, reach)
        blocks[name] = slice(len(rows), len(rows) + count)
        rows += range(places[part][0] + first, places[part][0] + first + count)
        share = settings.flexible_arm.parameters.reach / REACH if block.unit in ("m", "m/s") else 1.0
        scale += [share * one for one in limits.scale] if settings.scaled else [1.0] * count
        bound += limits.bound
        mirror += np.resize(block.mirror or settings.mode.mirror, count).tolist()
    scales = np.array(scale)
    # rounded outwards, so that the float32 of a value at the bound is inside
    limit = np.nextafter((np.array(bound) / scales).astype(np.float32), np.float32(np.inf))
    signs = np.array(mirror, dtype=np.float32)
    return ObservationLayout(blocks, np.array(rows, dtype=np.int64), scales, limit, signs)

"""What an episode draws: values by its key for quantities, options and parameters of the arm (`options.DRAWABLE`).

A hash of the key and of the parameter's own place gives the value, whatever else is drawn. Quantities that kernels know
become reset requests. From options and parameters of the arm follow constants of the environment's lane, which are
written before the kernels begin its episode.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple
from zlib import crc32

import numpy as np
from numpy.typing import NDArray

from flexarm_env.codegen.elementary import STRIDE, mixed_bits
from flexarm_env.envs.corners import ends, further_draws
from flexarm_env.envs.distributions import ends_of, quantiles
from flexarm_env.envs.kernel_inputs import DIRECTION_CODES, fixed_rows, lane_numbers
from flexarm_env.envs.options import checked_ranges, each_of
from flexarm_env.envs.own_paths import OF_EACH, first_rows
from flexarm_env.envs.settings import Settings
from flexarm_env.episode.reset import PLACE_DRAWN, draw_path
from flexarm_env.kernels.entries import DRAWN, column
from flexarm_env.kernels.variants import Variant
from flexarm_env.parameters import ArmParameters
from flexarm_env.physics.constants import changes_of_like
from flexarm_env.validation import shown

Array = NDArray[np.float64]


class _Plan(NamedTuple):
    """How the episodes of one kind of environment are drawn; an entry for each number."""

    columns: NDArray[np.int64]  # of the reset requests
    salts: NDArray[np.uint64]  # of the numbers' places
    low: Array  # least value, or that of an environment that does not draw it; NaN: None
    span: Array  # of a uniform distribution
    others: list[tuple[int, Any]]  # entries and distributions of those that are not uniform

    def values(self, keys: NDArray[np.uint64]) -> Array:
        """Draw values by the keys of episodes. Shape (n, numbers)."""
        shares = (mixed_bits(keys[:, None] ^ self.salts) >> np.uint64(11)) * 2.0**-53  # `elementary.uniform`
        found = self.low + self.span * shares
        for n, distribution in self.others:
            found[:, n] = quantiles(distribution, shares[:, n])
        return found


class Draws:
    """The draws of a batch's episodes.

    Attributes:
        further: columns of the reset requests that hold options and parameters of the arm, by name.
        first: first column of these.
        columns: how many a reset request has.
        rows: names of the arena's rows that follow from these.
    """

    def __init__(self, kinds: Sequence[Settings], kind_of: NDArray[np.int64], first: int) -> None:
        """Find out what environments of some kinds (distinct settings) draw, each of its own. Shape (N,)."""
        self._kinds, self._kind_of, self.first, self.columns = kinds, kind_of, first, first
        self.further: dict[str, slice] = {}
        for name, each in {name: each for one in kinds for name, each in further_draws(one).items()}.items():
            self.further[name] = slice(self.columns, self.columns + len(each))
            self.columns += len(each)
        corners = [tuple(map(fixed_rows, (one, *ends(one)))) for one in kinds]
        self.chosen_path = self.columns if kinds[0].path_rows else None  # column; that of the kernels is the lane
        self.columns += self.chosen_path is not None
        self.rows = {
            name
            for own, *two in corners
            for name in own
            for x in two
            if not (name.startswith("NOMINAL") or np.array_equal(own[name], x[name]))  # these stay as declared
        }
        self._set([one.randomisation for one in kinds])

    def narrow(self, given: Mapping[str, Any]) -> None:
        """Let all environments draw the episodes to come from these distributions; what is left out keeps its own.

        Memory, integration step and bounds are those of the distributions at make, so that others must be within them.
        """
        label = "options['randomisation']"
        new = checked_ranges(label, given)
        for name, made in ((name, one.randomisation) for one in self._kinds for name in new):
            if name not in made:
                raise ValueError(f"{label}[{name!r}]: it was not drawn at make")
            for wanted, known in zip(each_of(name, new[name]), each_of(name, made[name]), strict=True):
                (low, high), (least, most) = ends_of(wanted), ends_of(known)
                if low < least or high > most:
                    raise ValueError(f"{label}[{name!r}] = {shown(new[name])}: must be from {least} to {most}")
        self._set([old | new for old in self._ranges])

    def _set(self, ranges: Sequence[Mapping[str, Any]]) -> None:
        self._ranges = [dict(each) for each in ranges]
        self._plans = [self._plan(*both) for both in zip(self._kinds, self._ranges, strict=True)]

    def _plan(self, settings: Settings, ranges: Mapping[str, Any]) -> _Plan:
        drawn = [(column.DRAWN + n, PLACE_DRAWN + n, ranges[name]) for n, name in enumerate(DRAWN) if name in ranges]
        for name, where in self.further.items():
            places = range(where.start, where.stop)
            own = getattr(settings, name) if name in vars(settings) else getattr(settings.flexible_arm.parameters, name)
            fixed = ((x, x) for x in np.broadcast_to(np.nan if own is None else own, len(places)).tolist())
            each = each_of(name, ranges[name]) if name in ranges else fixed
            hashed = crc32(name.encode()) << 20
            drawn += [(at, hashed + n, one) for n, (at, one) in enumerate(zip(places, each, strict=True))]
        salts = mixed_bits(np.array([place + 1 for _, place, _ in drawn], dtype=np.uint64) * np.uint64(STRIDE))
        low, high = np.array([ends_of(one) for _, _, one in drawn]).reshape(-1, 2).T
        others = [(n, one) for n, (_, _, one) in enumerate(drawn) if isinstance(one[0], str)]
        return _Plan(np.array([at for at, _, _ in drawn], dtype=np.int64), salts, low, high - low, others)

    @property
    def nothing(self) -> bool:
        """Whether nothing is drawn."""
        return not any(self._ranges)

    def completed(self, requests: Array, keys: NDArray[np.uint64], which: NDArray[np.int64]) -> Array:
        """Draw what the requests of environments that begin an episode leave open, in place. Shape (n, columns)."""
        kind_of = self._kind_of[which]
        for kind in np.unique(kind_of).tolist():
            plan, chosen = self._plans[kind], np.flatnonzero(kind_of == kind)
            places = np.ix_(chosen, plan.columns)
            requests[places] = np.where(np.isnan(requests[places]), plan.values(keys[chosen]), requests[places])
        return requests

    def values(self, requests: Array) -> dict[str, Array]:
        """Return options and parameters of the arm in requests that are complete; NaN: None. Shape (n,) or (n, 2)."""
        found = {name: requests[:, where] for name, where in self.further.items()}
        return {name: both.copy() if both.shape[1] > 1 else both[:, 0].copy() for name, both in found.items()}

    def path(self, request: Array, index: int, key: int, rows: int) -> Array:
        """Return the path that follows from an environment's request, and write its place into the request."""
        options = self._kinds[self._kind_of[index]].having(self._numbers(request))
        if options.reference[0] not in OF_EACH:
            direction = DIRECTION_CODES[options.direction]
            with np.errstate(over="ignore"):  # words of keys
                request[self.chosen_path] = draw_path(np.uint64(key), len(options.reference), direction, request)
            request[[column.PATH, column.DIRECTION]] = index, 0.0
        return first_rows(options, key, rows, int(np.nan_to_num(request[self.chosen_path])))

    def _numbers(self, request: Array) -> dict[str, Any]:
        """Return what an environment's request has for options and parameters of the arm, without None."""
        return {name: x[0].tolist() for name, x in self.values(request[None]).items() if not np.isnan(x).any()}

    def constants(self, request: Array, index: int, variant: Variant) -> tuple[dict[str, Any], Array]:
        """Return the rows that follow from an environment's request, and its own settings (`entries.LaneSetting`)."""
        settings = self._kinds[self._kind_of[index]]
        drawn = self._numbers(request)
        of_arm = {name: drawn.pop(name) for name in list(drawn) if name in ArmParameters.__dataclass_fields__}
        arm, options = settings.flexible_arm, settings.having(drawn)
        changes = changes_of_like(replace(arm.parameters, **of_arm), arm.changes) if of_arm else arm.changes
        rows = fixed_rows(options)
        return {name: rows[name] for name in self.rows}, lane_numbers(options, variant, changes)

"""What environments report beside observations: named parts of a fleet's results.

Truth that no sensor knows is here, never in an observation.
"""

from __future__ import annotations

from collections.abc import Iterable
from operator import itemgetter
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from flexarm_env.envs.batch import Fleet
from flexarm_env.episode.reward import TERMS
from flexarm_env.kernels.layout import DRAWN

Array = NDArray[np.float64]


class Key(NamedTuple):
    """What a key of an info holds.

    Attributes:
        what: description.
        unit: of its numbers.
        when: it is there.
    """

    what: str
    unit: str = ""
    when: str = "always"


KEYS = {
    "torque": Key("of shoulder and elbow at the start of the period that ended; 0 after a reset", "N m"),
    "true_tip": Key("where the tip is, with deflection", "m"),
    "rigid_tip": Key("where it would be by rigid kinematics of the true joint angles", "m"),
    "reference": Key("where it should be", "m"),
    "sensed": Key("latest reading of the sensor on link 2", "m"),
    "state": Key(
        "theta1, theta2, modal coordinates of link 1, of link 2, and the rates of all of these; shape (4 + 4 m,)",
        "rad, 1, rad/s, 1/s",
    ),
    "time": Key("since the episode began", "s"),
    "gain": Key("lambda in the period that ended", "1", 'always, where `action_mode` is "gain"'),
    "reward_terms": Key("weighted terms that the reward is the sum of, by name", "1", "after a step"),
    "parameters": Key(f"quantities of the episode, drawn or not: {', '.join(DRAWN)}", "", "after a reset"),
    "path": Key("name of the reference that the episode follows", "", "after a reset"),
    "start_time": Key("moment of the lap at which the episode began", "s", "after a reset"),
    "termination_reason": Key("why the episode terminated; see Episode end", "", "when it did"),
}
ONLY = np.zeros(1, dtype=np.int64)  # the only environment
# Key in `info`, part of the results, and how many of its numbers.
_VECTORS = {
    "torque": ("TORQUE", 2),
    "true_tip": ("TRUE_TIP", 2),
    "rigid_tip": ("RIGID_TIP", 2),
    "reference": ("REFERENCE", 2),
    "sensed": ("SENSED", 2),
    "state": ("STATE", None),
}


class InfoMaker:
    """Turns results into infos, of one environment or of a batch."""

    def __init__(self, fleet: Fleet) -> None:
        """Note where everything lies.

        Args:
            fleet: the environments.
        """
        self._fleet = fleet
        parts = fleet.parts
        self._time, self._gain = parts["TIME"].start, parts["EFFECTIVE_GAIN"].start
        self._with_gain = fleet.settings.action_mode == "gain"
        vectors = {}
        for name, (part, count) in _VECTORS.items():
            start, stop = parts[part].start, parts[part].stop
            vectors[name] = slice(start, stop if count is None else start + count)
        first = parts["REWARD_TERMS"].start
        weights = fleet.settings.reward_weights
        self._vectors = itemgetter(*vectors.values())
        gain = {"gain": self._gain} if self._with_gain else {}
        self._items = _flagged((vectors | {"time": self._time} | gain).items())
        self._numbers = slice(first, None)  # all that are reported one by one come last
        self._term_items = _flagged((name, n) for n, name in enumerate(TERMS) if weights.get(name, 0.0) > 0.0)
        self._drawn, self._start_time = parts["EPISODE"], parts["START_TIME"].start
        self._drawn_items = _flagged((name, n) for n, name in enumerate(DRAWN))
        self._time_place, self._gain_place = self._time - first, self._gain - first
        self._reward_place, self._status_place = parts["REWARD"].start - first, parts["STATUS"].start - first

    def after_reset(self) -> dict[str, Any]:
        """The info of the only environment at the beginning of an episode.

        From that of a step, since a function for what both share would cost each step a call.
        """
        info, _, _ = self.after_step()
        del info["reward_terms"]
        known = self._fleet.only_result
        info["parameters"] = dict(zip(DRAWN, known[self._drawn].tolist(), strict=True))
        info["path"] = self._fleet.path_names(ONLY)[0]
        info["start_time"] = known[self._start_time].item()
        return info

    def after_step(self) -> tuple[dict[str, Any], float, float]:
        """The info of the only environment, its reward and its status.

        Written out, since a loop over `_VECTORS` would take 0.2 us more, a twentieth of a step.
        """
        fleet = self._fleet
        torque, true_tip, rigid_tip, reference, sensed, state = self._vectors(fleet.only_result.copy())
        numbers = fleet.only_numbers.tolist()
        info: dict[str, Any] = {
            "torque": torque,
            "true_tip": true_tip,
            "rigid_tip": rigid_tip,
            "reference": reference,
            "sensed": sensed,
            "state": state,
            "time": numbers[self._time_place],
        }
        if self._with_gain:
            info["gain"] = numbers[self._gain_place]
        info["reward_terms"] = terms = {}
        for name, _, place in self._term_items:
            terms[name] = numbers[place]
        return info, numbers[self._reward_place], numbers[self._status_place]

    def batch(self, begun: NDArray[np.int64], stepped: bool) -> dict[str, Any]:
        """The infos of a batch in Gymnasium's form: arrays, and for each a mask of the environments that have it.

        Keys of the same environments share a mask, which therefore cannot be written to.

        Args:
            begun: environments that were reset. Shape (n,).
            stepped: a step led the others there; False: they have no info.
        """
        known = self._fleet.results
        count = len(known)
        fresh = np.zeros(count, dtype=np.bool_)
        fresh[begun] = True
        others, everyone = ~fresh, self._fleet.everyone
        fresh.setflags(write=False)
        others.setflags(write=False)
        if not stepped and len(begun) < count:
            known, everyone = np.where(fresh[:, None], known, 0.0), fresh
        infos: dict[str, Any] = {}
        for name, flag, part in self._items:
            infos[name], infos[flag] = known[:, part], everyone
        if stepped and len(begun) < count:  # an episode that begins has no reward: its terms are 0
            infos["reward_terms"] = _named(known.T[self._numbers], self._term_items, others)
            infos["_reward_terms"] = others
        if len(begun):
            infos["parameters"] = _named(known.T[self._drawn], self._drawn_items, fresh)
            infos["_parameters"] = infos["_path"] = infos["_start_time"] = fresh
            infos["path"], infos["start_time"] = self._fleet.path_names(begun), known[:, self._start_time]
        return infos


def _flagged(items: Iterable[tuple[str, Any]]) -> tuple[tuple[str, str, Any], ...]:
    """Names and places, with the name of the mask between."""
    return tuple((name, f"_{name}", place) for name, place in items)


def _named(rows: Array, items: tuple[tuple[str, str, int], ...], mask: NDArray[np.bool_]) -> dict[str, Any]:
    """Rows by name, each with the mask of the environments that have it."""
    named: dict[str, Any] = {}
    for name, flag, place in items:
        named[name], named[flag] = rows[place], mask
    return named

"""Infos of the environments: named parts of a batch's results.

True values that no sensor measures are in infos, never in observations. An info is flat, and has the same keys after a
reset and after a step; each value is a number or an array of float64. `Episode` describes an episode as a whole.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from flexarm_env.envs.batch import BatchSimulator
from flexarm_env.envs.sensors import FURTHER
from flexarm_env.envs.settings import Settings
from flexarm_env.envs.termination import END_CODES, NOT_TERMINATED
from flexarm_env.episode.reward import TERMS
from flexarm_env.kernels.entries import DRAWN
from flexarm_env.physics.inverse_kinematics import STRAIGHT

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]


class Key(NamedTuple):
    """Declaration of a key of infos.

    Attributes:
        what: meaning of the value.
        unit: unit of its numbers.
        part: part of the results that holds it; "" for `end_code`, which follows from the status.
        size: length of the array; 0: the value is a number; None: the array is the whole part.
        where: environments that have it; "" for all.
        first: its first number in the part.
    """

    what: str
    unit: str
    part: str
    size: int | None = 0
    where: str = ""
    first: int = 0


TERM = "reward_"  # prefix of the key of a term of the reward
_RACE = '`action_mode` is "race"'
KEYS = {
    "torque": Key(
        "of shoulder and elbow at the start of the period that ended, its mean where motors are not ideal; 0 after a "
        "reset; shape (2,)",
        "N m",
        "TORQUE",
        2,
    ),
    "true_tip": Key("position of the tip, with deflection; shape (2,)", "m", "TRUE_TIP", 2),
    "rigid_tip": Key(
        "position of the tip by rigid kinematics of the true joint angles; shape (2,)", "m", "RIGID_TIP", 2
    ),
    "reference": Key("where the tip should be; shape (2,)", "m", "REFERENCE", 2),
    "sensed": Key("latest reading of the sensor on link 2; shape (2,)", "m", "LINK_SENSOR", 2),
    "state": Key(
        "theta1, theta2, modal coordinates of link 1, of link 2, and the rates of all of these; shape (4 + 4 m,)",
        "rad, 1, rad/s, 1/s",
        "STATE",
        None,
    ),
    "time": Key("since the episode began", "s", "TIME"),
    "tip_error": Key("distance of the true tip from the target", "m", "TIP_ERROR"),
    "elbow_side": Key(
        f"sign of sin(theta2) when the elbow was last bent by more than {STRAIGHT:g} rad, off the straight and off the "
        "folded arm; 0 before",
        "1",
        "ELBOW_SIDE",
    ),
    "elbow_changes": Key(
        "how often `elbow_side` has changed sign since the episode began, seen at each control period",
        "1",
        "ELBOW_CHANGES",
    ),
    "end_code": Key(
        "code of the reason why the episode terminated; 0 while it goes on, and where a time limit truncates it",
        "1",
        "",
    ),
    **{
        TERM + name: Key(
            "this term of the reward times its weight; 0 after a reset",
            "1",
            "REWARD_TERMS",
            where=f"`{name}` has a weight",
            first=n,
        )
        for n, name in enumerate(TERMS)
    },
    "gain": Key(
        "lambda in the period that ended; 0 after a reset", "1", "EFFECTIVE_GAIN", where='`action_mode` is "gain"'
    ),
    "is_success": Key(
        "1 once a lap is complete through whose final rest the true tip was within 2 cm of the target; 0 before. With "
        "another reference: 1 once the payload has changed and the tip was within 2 cm of the target whenever it did",
        "1",
        "SUCCESS",
        where='`reference` is "moves" or `payload_changes` is set',
    ),
    "progress": Key("way of the reference since the episode began", "m", "PROGRESS", where=_RACE),
    "reference_speed": Key("speed of the reference in the period that ended", "m/s", "REFERENCE_SPEED", where=_RACE),
    "lap_times": Key(
        "of the first lap, of the fastest, of all; 0 where these are not done; shape (3,)", "s", "LAP_TIMES", 3, _RACE
    ),
    "payload": Key("mass that the tip carries", "kg", "CARRIED", where="`payload_changes` is set"),
    **{
        sensor.info: Key(
            f"latest reading of the {sensor.title}; shape ({sensor.size},)",
            sensor.unit,
            "FURTHER_READING",
            sensor.size,
            f"`{sensor.name}_link` is set",
        )
        for sensor in FURTHER
    },
}
GOES_ON = np.float64(END_CODES[NOT_TERMINATED])
_LITERAL = 15  # CPython makes a dictionary of more items key by key, with the table resized on the way


def info_keys(settings: Settings) -> tuple[str, ...]:
    """Return the keys of an environment's infos, in their order."""
    left_out = {TERM + name for name in TERMS if settings.reward_weights.get(name, 0.0) == 0.0}
    if settings.mode.law != "tip":
        left_out.add("gain")
    if settings.reference != ("moves",) and not settings.payload_changes:
        left_out.add("is_success")
    if not settings.mode.races:
        left_out |= {name for name, key in KEYS.items() if key.where == _RACE}
    if not settings.payload_changes:
        left_out.add("payload")
    left_out |= {sensor.info for sensor in FURTHER} - {one.sensor.info for one in settings.further_sensors}
    return tuple(name for name in KEYS if name not in left_out)


class Episode(NamedTuple):
    """Description of an episode as a whole.

    For a single environment the values are numbers and names, for a batch arrays of shape (N,).

    Attributes:
        parameters: by name `delay` [s], `payload_mass` [kg], `stiffness` [1], `damping` [1], `noise` [m],
            `actuation_delay` [s], drawn or not; then what else `randomisation` names.
        path: name of the path.
        start_time: moment of the lap at which the episode began [s]; of a race the place on the path [m].
        elbow_branch: on which side of 0 theta2 is for the rigid arm on the target, "positive" or "negative".
        direction: of the lap of a path with a name, "counterclockwise" or "clockwise"; of other paths it says nothing.
    """

    parameters: dict[str, Any]
    path: Any
    start_time: Any
    elbow_branch: Any
    direction: Any

    def one(self, index: int) -> Episode:
        """Return the episode of one environment of a batch."""
        parameters, *others = self
        drawn = {name: values[index].tolist() for name, values in parameters.items()}
        return Episode(drawn, *(each[index].item() for each in others))


def episodes(simulator: BatchSimulator) -> Episode:
    """Describe the present episodes of a batch."""
    numbers = simulator.episode_data()
    return Episode(
        parameters={name: numbers[:, n].copy() for n, name in enumerate(DRAWN)} | simulator.drawn_values(),
        path=simulator.path_names(),
        start_time=numbers[:, len(DRAWN)].copy(),
        elbow_branch=np.where(numbers[:, len(DRAWN) + 1] > 0.0, "positive", "negative"),
        direction=simulator.directions(),
    )


def _reader(keys: Sequence[str], places: Mapping[str, Any], results: Array) -> Callable[[], dict[str, Any]]:
    """Generate a function that makes an info: `known = copy(); info = {"time": known[time]}; return info`.

    The function is generated from text because the keys depend on the options, and a loop would slow each step down.
    Its names are defaults of its arguments, which are found faster than attributes. It copies the results once; the
    arrays of an info are views of that copy.

    Args:
        keys: keys of the info, in their order; the value of a key without a place, `end_code`, is `GOES_ON`.
        places: indices or slices of the other keys' values in the results.
        results: results of one environment, which each step overwrites. Shape (k,).
    """
    values = {name: f"known[{name}]" if name in places else "GOES_ON" for name in keys}
    first, others = keys[:_LITERAL], keys[_LITERAL:]
    lines = [
        "known = copy()",
        f"info = {{{', '.join(f'{name!r}: {values[name]}' for name in first)}}}",
        *(f"info[{name!r}] = {values[name]}" for name in others),
        "return info",
    ]
    defaults = ", ".join(f"{name}={name}" for name in (*places, "GOES_ON", "copy"))
    names = {**places, "GOES_ON": GOES_ON, "copy": results.copy}
    exec("\n ".join([f"def read({defaults}):", *lines]), names)
    read: Callable[[], dict[str, Any]] = names["read"]
    return read


class InfoMaker:
    """Makes infos from the results of one environment or of a batch.

    Attributes:
        read: makes a single environment's info, with the `end_code` of an episode that goes on.
        codes: `end_code` of each status.
    """

    def __init__(self, simulator: BatchSimulator) -> None:
        """Find the places of all keys in the results."""
        self._simulator = simulator
        parts, keys = simulator.parts, info_keys(simulator.settings)
        firsts = {one.sensor.info: one.first for one in simulator.settings.further_sensors}
        places: dict[str, int | slice] = {}
        for name in keys:
            key = KEYS[name]
            if key.part:
                first, stop = parts[key.part].start + firsts.get(name, key.first), parts[key.part].stop
                places[name] = first if key.size == 0 else slice(first, first + key.size if key.size else stop)
        self._items = tuple((name, f"_{name}", place) for name, place in places.items())
        # A simulator's views never change; a copy of the simulator gets its own `InfoMaker`.
        self.read = _reader(keys, places, simulator.single_result)
        self.codes = {
            status: np.float64(END_CODES[reason or NOT_TERMINATED]) for status, reason in simulator.failures.items()
        }

    def __reduce__(self) -> tuple[type[InfoMaker], tuple[BatchSimulator]]:
        """Make copies and pickles anew from their simulator, since a generated function cannot be pickled."""
        return InfoMaker, (self._simulator,)

    def quantities(self, known: Array) -> dict[str, Array]:
        """Name the quantities in results, which infos hold beside `end_code`. Shape (N, k)."""
        return {name: known[:, place] for name, _, place in self._items}

    def batch(self) -> dict[str, Any]:
        """Make the infos of a batch in Gymnasium's form: for each key an array and a mask of the environments with it.

        All environments have each key; the keys share one mask, which is therefore read-only. `end_code` is 0.
        """
        known, everyone = self._simulator.results, self._simulator.everyone
        infos: dict[str, Any] = {"end_code": np.zeros(len(known)), "_end_code": everyone}
        for name, flag, place in self._items:
            infos[name], infos[flag] = known[:, place], everyone
        return infos


def masked(infos: Mapping[str, Any], mask: Flags) -> dict[str, Any]:
    """Restrict the infos of a batch to environments of a mask; the others have zeros. Shape (N,)."""
    flag = mask.copy()
    flag.setflags(write=False)
    some: dict[str, Any] = {}
    for name, values in infos.items():
        if not name.startswith("_"):
            some[name], some[f"_{name}"] = np.where(flag.reshape(-1, *(1,) * (values.ndim - 1)), values, 0.0), flag
    return some

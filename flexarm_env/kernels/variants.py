"""What drivers take: a `Variant`, whose numbers are constants for the compiler, and a `Block` of lanes.

A block has views of the memory of a batch (`codegen.memory`).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple, cast

import numpy as np

from flexarm_env.codegen.arrays import Arena, Clock, History, Keys, Mask, Memory, Paths, Table, Words
from flexarm_env.codegen.declarations import PresentVariant, Program
from flexarm_env.codegen.intrinsics import array_at
from flexarm_env.codegen.rows import lane_rows
from flexarm_env.kernels.entries import CLOCK_ROWS, READING_ROWS, word
from flexarm_env.kernels.layout import Row, slope_sizes, slope_ways
from flexarm_env.parameters import SENSOR_MODELS, SensorModel
from flexarm_env.physics import linear_algebra
from flexarm_env.physics.constants import Constants
from flexarm_env.physics.sensing import POSITION, QUANTITIES_AT_A_POINT


@dataclass(frozen=True)
class Variant:
    """What a kernel module is compiled for.

    Attributes:
        program: program of the kernels.
        modes: per link.
        complete: complete velocity forces, or C_r.
        lanes: environments in a block.
        sensor: model of the sensor; those that read the same share kernels (`shared_model`).
        rate_jacobian: "delayed" or "current" (where the law acts).
        law_on_sensor: the law acts on the sensor's late readings; False: on the joints' own, whatever the sensor.
        own_paths: each episode draws a path of its own (environments only).
        foreshortened: kinematics (`bent_link`).
        disturbed: noise, jitter, dropouts, a sensor with a clock of its own, or late torques can occur (environments
            only); they take time to compile.
        sensors: quantity and link of each further sensor (`sensing.QUANTITIES_AT_A_POINT`; environments only).
        dry: joints have dry friction.
        motors: torques pass through motors that are not ideal (`motors`; environments only).
        payloads: how many changes of the payload a lap has (`episode.payload`; environments only).
        pulses: forces act at the tip (environments only).
        drifting: strain gauges drift (environments only).
    """

    program: Program
    modes: int
    complete: bool
    lanes: int
    sensor: SensorModel = "rigid"
    rate_jacobian: str = "delayed"
    law_on_sensor: bool = True
    own_paths: bool = False
    foreshortened: bool = False
    disturbed: bool = False
    sensors: tuple[tuple[str, int], ...] = ()
    dry: bool = False
    motors: bool = False
    payloads: int = 0
    pulses: bool = False
    drifting: bool = False

    @property
    def kind(self) -> str:
        """Name of the program."""
        return self.program.name

    @property
    def groups(self) -> frozenset[str]:
        """Groups whose parts the tables have (`layout`)."""
        groups = self.program.groups | {"further sensors"} if self.sensors else self.program.groups
        return groups | {name for name in ("motors", "payloads", "pulses", "drifting") if getattr(self, name)}

    @property
    def rows(self) -> dict[str, tuple[int, int]]:
        """Layout of its arenas."""
        return Row.layout(self)

    @property
    def size(self) -> int:
        """Number of internal coordinates."""
        return 2 * self.modes + 2

    @property
    def constants(self) -> int:
        """How many numbers the constants of an arm are."""
        return linear_algebra.extent(Constants.sizes(self.modes, self.foreshortened, self.dry))

    @property
    def pairs(self) -> int:
        """How many numbers the foreshortening at a point is."""
        return self.foreshortened * self.modes * (self.modes + 1) // 2

    @property
    def slot_rows(self) -> int:
        """Rows of a slot of the delay line (`entries.ReadingRow`)."""
        return READING_ROWS * (1 + self.further_points) + self.further_readings - 2 * self.further_points

    @property
    def further_points(self) -> int:
        """How many further sensors read positions; they come first."""
        return sum(name == POSITION for name, _ in self.sensors)

    @property
    def further_readings(self) -> int:
        """How many numbers the further sensors read."""
        return sum(QUANTITIES_AT_A_POINT[name].size for name, _ in self.sensors)

    @property
    def ways(self) -> int:
        """How many inputs Jacobians are derivatives by."""
        return len(slope_ways(self.modes))

    @property
    def slope_rows(self) -> int:
        """How many numbers Jacobians need of a stage."""
        return sum(slope_sizes(self.modes).values())

    @property
    def batch(self) -> bool:
        """Whether a block has several lanes."""
        return self.lanes > 1

    @property
    def true_sensor(self) -> bool:
        """Whether the sensor sees the bent link."""
        return SENSOR_MODELS[self.sensor].bends

    @property
    def hosted(self) -> bool:
        """Whether another engine advances the plant."""
        return "hosted" in self.program.groups

    @property
    def law(self) -> bool:
        """Whether the paper's law acts."""
        return "law" in self.program.groups

    @property
    def episodes(self) -> bool:
        """Whether it steps environments."""
        return "environment" in self.program.groups

    @property
    def tracking(self) -> bool:
        """Whether the joint-space law acts."""
        return "tracking" in self.program.groups

    @property
    def racing(self) -> bool:
        """Whether the reference moves at a speed of the action's, not by the clock (`episode.race`)."""
        return "race" in self.program.groups

    @property
    def reward_terms(self) -> int:
        """How many terms the reward has."""
        return self.program.reward_terms

    @property
    def description(self) -> str:
        """Description for the user who waits for the compiler."""
        parts = [
            self.program.description,
            "one environment" if self.lanes == 1 else f"blocks of {self.lanes} environments",
            "1 mode a link" if self.modes == 1 else f"{self.modes} modes a link",
        ]
        further = {
            "the paper's velocity forces": not self.complete,
            "foreshortened links": self.foreshortened,
            "true tip sensed": self.true_sensor,
            "law on the late sensor": self.law and self.law_on_sensor,
            "drawn paths": self.own_paths,
            "disturbances": self.disturbed,
            "dry friction": self.dry,
            "motors": self.motors,
            f"{self.payloads} changes of the payload": self.payloads,
            "pulses of force": self.pulses,
            "gauges that drift": self.drifting,
        }
        parts += [text for text, has in further.items() if has]
        parts += [f"a sensor of {quantity} on link {link}" for quantity, link in self.sensors]
        return ", ".join(parts)


def shared_model(model: SensorModel) -> SensorModel:
    """Return the model whose kernels serve a model: of those that read the same, the one with the most delays."""
    traits = SENSOR_MODELS[model]
    alike: list[SensorModel] = [name for name, other in SENSOR_MODELS.items() if other.reading == traits.reading]
    return max(alike, key=lambda name: SENSOR_MODELS[name].late)


variant = cast(Variant, PresentVariant())  # as drivers see it


class Block(NamedTuple):
    """Some environments, its lanes.

    Attributes:
        memory: of the batch.
        first: lane of the block among all.
        header: see `entries.Header`.
        settings: see `entries.Setting`.
        arena: all that is known of the lanes (`layout.Row`).
        history: readings at past steps (`delay_line`).
        clock: of each lane (`entries.ClockRow`).
        paths: of all lanes.
        started: lanes that begin an episode.
        keys: of the lanes' episodes.
        active: lanes that observe.
    """

    memory: Memory
    first: int
    header: Words
    settings: Table
    arena: Arena
    history: History
    clock: Clock
    paths: Paths
    started: Mask
    keys: Keys
    active: Mask


def block_at(memory: Memory, number: int) -> Block:
    """Return a block of a batch; the header, which comes first, has the places of the arrays (`entries.Word`)."""
    words = array_at(memory, word.HEADER_WORDS, (1,), np.int64)[0]
    header = array_at(memory, 0, (words,), np.int64)
    first, lanes = number * variant.lanes, variant.lanes
    rows, readings = header[word.ARENA_ROWS], header[word.HISTORY_ROWS]
    paths = (header[word.PATH_COUNT], header[word.PATH_POINTS], 5)
    return Block(
        memory,
        first,
        header,
        array_at(memory, header[word.SETTINGS], (header[word.SETTING_NUMBERS],), np.float64),
        lane_rows(array_at(memory, header[word.ARENAS] + first * rows, (rows, lanes), np.float64), variant.lanes),
        lane_rows(
            array_at(memory, header[word.HISTORIES] + first * readings, (readings, lanes), np.float64), variant.lanes
        ),
        array_at(memory, header[word.CLOCKS] + first * CLOCK_ROWS, (CLOCK_ROWS, lanes), np.int64),
        array_at(memory, header[word.PATHS], paths, np.float64),
        array_at(memory, header[word.STARTS], (first + lanes,), np.bool_)[first:],
        array_at(memory, header[word.KEYS], (first + lanes,), np.uint64)[first:],
        array_at(memory, header[word.ACTIVE], (first + lanes,), np.bool_)[first:],
    )

"""The rows of an arena, each declared once; `entries` has the other tables that kernels read.

An arena holds some environments, its lanes: one row of numbers for each quantity (`arrays`). A program's groups say
which rows its arenas have:

- "law": the paper's law acts (`jacobian_transpose`),
- "tracking": the joint-space law tracks the reference (`joint_tracking`),
- "environment": an environment (`episode`),
- "hosted": an environment whose arm is another engine's (`envs.hosted`),
- "race": the reference moves at a speed of the action's (`race`),
- "payloads": the payload changes within the lap (`payload`),
- "motors": its torques pass through motors that are not ideal (`motors`),
- "pulses": forces act at the tip (`disturbances`),
- "drifting": strain gauges drift (`disturbances`),
- "further sensors": the environment has sensors beside the one on link 2 (`Variant.groups`),
- "tangents": Jacobians are carried along (`step_jacobians`),
- "adjoint": a gradient is carried back (`step_gradients`),
- "outputs": readings and tips with their Jacobians (`output_jacobians`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from operator import attrgetter
from typing import Any

from flexarm_env.codegen.declarations import Entry, Names
from flexarm_env.control.jacobian_transpose import Law
from flexarm_env.kernels.entries import CONSTANTS_UNIT, DRAWN_COUNT, SEGMENT_ROWS, STATE_UNIT
from flexarm_env.kernels.tableau import IMEX_STAGES, RK4_NODES
from flexarm_env.physics import linear_algebra
from flexarm_env.physics.bent_link import PointShape
from flexarm_env.physics.constants import ARM_QUANTITIES, Constants
from flexarm_env.physics.modal_elimination import Elimination, elimination
from flexarm_env.physics.sensing import OUTPUT_SIZES

OUTPUTS = sum(OUTPUT_SIZES)  # how many numbers


def slope_ways(modes: int) -> list[tuple[str, int]]:
    """Return the inputs by which `step_jacobians` differentiates, in their order: kind and place of each."""
    size = 2 * modes + 2
    counts = {"y": range(1, size), "v": range(size), "tau": range(2), "quantity": range(len(ARM_QUANTITIES))}
    return [(name, n) for name, places in counts.items() for n in places]


def slope_sizes(modes: int) -> dict[str, int]:
    """Return what `step_jacobians` keeps of a stage, in its order, and how many numbers each is.

    M and its inverse (lower triangles); the derivatives of the momenta ``M(y) v`` and of the force p' by the positions
    without a1; those of the force by the rates; those of both by each input that acts all the time.
    """
    size = 2 * modes + 2
    triangle, acting = size * (size + 1) // 2, 2 + len(ARM_QUANTITIES)
    by_y = (size - 1) * size
    return {
        "mass": triangle,
        "inverse": triangle,
        "momentum_by_y": by_y,
        "force_by_y": by_y,
        "force_by_v": size * size,
        "inputs": acting * 2 * size,
    }


def _law(field: str) -> Callable[[Any], int]:
    return lambda variant: Law.sizes(variant.modes, variant.foreshortened)[field]


_size, _modes, _pairs, _readings = map(attrgetter, ("size", "modes", "pairs", "further_readings"))  # of a `Variant`
_MEASURED = ("environment", "outputs")
_LAW = ("law",)
_TRACKING = ("tracking",)
_ENVIRONMENT = ("environment",)
_HOSTED = ("hosted",)
_FURTHER = ("further sensors",)
_MOTORS = ("motors",)
_PAYLOADS = ("payloads",)
_PULSES = ("pulses",)
_DRIFTING = ("drifting",)
_RACE = ("race",)
_TANGENTS = ("tangents",)
_ADJOINT = ("adjoint",)
_OUTPUTS = ("outputs",)


class Row(Names):
    """Rows of an arena."""

    Y = Entry("internal coordinates (`dynamics`)", "rad, 1", _size)
    V = Entry("their rates; they follow the coordinates", "rad/s, 1/s", _size)
    STARTS = Entry("1 where an episode starts, else 0", "1", 1, _ENVIRONMENT)
    P = Entry("generalised momenta M(y) v, as the latest step left them", "N m s", _size)
    FORCE = Entry("their rates of change without the motors' part", "N m", _size)
    CONSTANTS = Entry("what the equations know of the arm (`Constants`)", CONSTANTS_UNIT, lambda s: s.constants)
    ELIMINATION = Entry(
        "what follows from them (`Elimination`)",
        "as in `Elimination`",
        lambda s: 0 if s.foreshortened else linear_algebra.extent(Elimination.sizes(s.modes)),
    )

    GAIN = Entry("gain lambda of the paper's law", "1", _law("gain"), _LAW)
    GAIN_LIMIT = Entry("gain of the action 1", "1", 1, _LAW)
    PROPORTIONAL_GAIN = Entry("Kp", "N/m", _law("proportional_gain"), _LAW)
    DERIVATIVE_GAIN = Entry("Kd", "N s/m", _law("derivative_gain"), _LAW)
    TORQUE_LIMIT = Entry("of shoulder and elbow", "N m", 2, ("law", "environment"))
    SENSOR_DISTANCE = Entry("of the point that the law acts on from the elbow", "m", 1, _LAW)
    SENSOR_VALUES = Entry("link 2's mode shapes there", "m", _law("sensor_values"), _LAW)
    SENSOR_FORESHORTENING = Entry("foreshortening there", "m", _law("sensor_foreshortening"), _LAW)
    NOISE = Entry("added to the reading's position", "m", _law("noise"), _LAW)
    COMMAND_1 = Entry("reference position and velocity in the shoulder's torque", "m, m/s", _law("command_1"), _LAW)
    COMMAND_2 = Entry("the same in the elbow's", "m, m/s", _law("command_2"), _LAW)
    OFFSET = Entry("late part of the two readings", "rad or m", _law("offset"), _LAW)
    WEIGHT = Entry("share of the current readings", "1", _law("weight"), _LAW)
    RATE_OFFSET = Entry("late part of the readings' rates", "rad/s or m/s", _law("rate_offset"), _LAW)
    RATE_WEIGHT = Entry("share of the current rates", "1", _law("rate_weight"), _LAW)
    DELAY = Entry("of the two readings in the law", "s", 2, _LAW)
    COMPENSATION = Entry("delay of the commands: 0 none, 1 the shoulder's for both, 2 each joint's own", "1", 1, _LAW)
    COMMAND_DELAY = Entry("of the commands of shoulder and elbow", "s", 2, _LAW)
    COMMAND_SEGMENT = Entry("segment of the path for the commands (`entries.Segment`)", "s, m, m/s", SEGMENT_ROWS, _LAW)
    RATE_LATE = Entry("whether the rates are as late as the readings", "1", 1, _LAW)
    Y_STAGE = Entry("coordinates of the stage", "rad, 1", _size, _LAW)
    V_STAGE = Entry("rates of the stage", "rad/s, 1/s", _size, _LAW)
    MECHANICAL = Entry("acceleration of the stage without the law", "rad/s^2, 1/s^2", _size, _LAW)
    FEEDBACK = Entry("acceleration of the stage by the law", "rad/s^2, 1/s^2", _size, _LAW)
    TAU = Entry("torques of shoulder and elbow at the present step", "N m", 2)
    V_SLOTS = Entry("V_STAGE of the earlier stages", "rad/s, 1/s", lambda s: IMEX_STAGES * s.size, _LAW)
    MECHANICAL_SLOTS = Entry("MECHANICAL of the earlier stages", "rad/s^2, 1/s^2", lambda s: IMEX_STAGES * s.size, _LAW)
    FEEDBACK_SLOTS = Entry("FEEDBACK of the earlier stages", "rad/s^2, 1/s^2", lambda s: IMEX_STAGES * s.size, _LAW)

    CHANGES = Entry(
        "derivatives of CONSTANTS by each quantity",
        CONSTANTS_UNIT + ", per unit",
        lambda s: len(ARM_QUANTITIES) * s.constants,
        _TANGENTS,
    )
    TOTAL = Entry("weighted sum of the rates of Y and P", "as of V and FORCE", lambda s: 2 * s.size, _TANGENTS)
    STAGES = Entry("Y and V at a step's stages", STATE_UNIT, lambda s: len(RK4_NODES) * 2 * s.size, _TANGENTS)
    SLOPES = Entry(
        "derivatives of the stages (`slope_sizes`)",
        "per unit",
        lambda s: len(RK4_NODES) * sum(slope_sizes(s.modes).values()),
        _TANGENTS,
    )
    COLUMNS = Entry(
        "derivatives of Y and P (at a period's ends, of Y and V) by each input",
        "per unit",
        lambda s: len(slope_ways(s.modes)) * 2 * s.size,
        _TANGENTS,
    )

    GRADIENT = Entry("derivatives of a sum by Y and P", "per unit", lambda s: 2 * s.size, _ADJOINT)
    STAGE_GRADIENT = Entry("by positions and momenta of the stage", "per unit", lambda s: 2 * s.size, _ADJOINT)
    GRADIENT_CHANGE = Entry("sum of STAGE_GRADIENT of a step's stages", "per unit", lambda s: 2 * s.size, _ADJOINT)
    TORQUE_GRADIENT = Entry("derivatives of the sum by TAU", "per N m", 2, _ADJOINT)

    OUTPUTS = Entry("what sensors read, and tips (`sensing.Outputs`)", "as there", OUTPUTS, _OUTPUTS)
    OUTPUT_SLOPES = Entry("their derivatives by STATE", "per unit", lambda s: 2 * s.size * OUTPUTS, _OUTPUTS)

    STIFFNESS = Entry("of the joint-space law", "N m/rad", 2, _TRACKING)
    RESISTANCE = Entry("damping of the joint-space law", "N m s/rad", 2, _TRACKING)
    INNER_FROM = Entry("joint angles and rates that it aims at, at the period's start", "rad, rad/s", 4, _TRACKING)
    INNER_TO = Entry("the same at the period's end", "rad, rad/s", 4, _TRACKING)
    SHIFT = Entry("commanded shift of the aim", "rad", 2, _TRACKING)
    STAGE_TORQUE = Entry("torque of the step's first stage", "N m", 2, _TRACKING)

    ACTION_SCALE = Entry("what an action of 1 stands for", "as `actions.MODES`", 2, _ENVIRONMENT)
    COMMAND_SCALE = Entry("what a kept command of 1 is (`Header.COMMANDS`)", "N m, rad or 1", 2, _ENVIRONMENT)
    MOTOR = Entry("torque of the current loops", "N m", 2, _MOTORS)
    MOTOR_RESPONSE = Entry(
        "of each joint at a step's start, middle and end, then the exact share at the end (`motors.response`)",
        "1",
        8,
        _MOTORS,
    )
    STALL_TORQUE = Entry("torque at rest; inf: no limit", "N m", 2, _MOTORS)
    PER_SPEED = Entry("one over the no-load speed; 0: no limit", "s/rad", 2, _MOTORS)
    TORQUE_UNIT = Entry("torque that commands are multiples of, over COMMAND_SCALE; 0: any", "1", 2, _MOTORS)
    TORQUE_LEVELS = Entry("largest multiple", "1", 2, _MOTORS)
    ACTED = Entry("mean torque of the latest step", "N m", 2, _MOTORS)

    PULSE_FORCE = Entry("of pulses at the tip", "N", 2, _PULSES)
    PULSE_TIMES = Entry("when the first begins, how long each lasts, from one to the next", "s", 3, _PULSES)
    TIP_FORCE = Entry("at the tip, mean of the step", "N", 2, _PULSES)
    GAUGE_DRIFT = Entry("of each link's first modal coordinate, as gauges read it", "1/s", 2, _DRIFTING)
    GAUGES = Entry("modal coordinates and rates, as gauges read them", "1, 1/s", lambda s: 4 * s.modes, _DRIFTING)
    MISSED = Entry("whether the tip was not near the reference when the payload changed", "1", 1, _PAYLOADS)

    PACE = Entry("largest speed of the reference, and its largest change", "m/s, m/s^2", 2, _RACE)
    RACE_LAPS = Entry("how many a race has", "1", 1, _RACE)
    LAP_BEGUN = Entry("when the present lap of a race began, since the episode began", "s", 1, _RACE)

    LIMITS = Entry("magnitudes of the state that end a run", STATE_UNIT, lambda s: 2 * s.size, _ENVIRONMENT)
    TIP_VALUES = Entry("link 2's mode shapes at the tip", "m", _modes, _MEASURED)
    TIP_DISTANCE = Entry("of the tip from the elbow", "m", 1, _MEASURED)
    TIP_FORESHORTENING = Entry("foreshortening at the tip", "m", _pairs, _MEASURED)

    SENSOR_POINT_DISTANCE = Entry("of the sensor from the elbow", "m", 1, _MEASURED)
    SENSOR_POINT_VALUES = Entry("link 2's mode shapes at the sensor", "m", _modes, _MEASURED)
    SENSOR_POINT_FORESHORTENING = Entry("foreshortening at the sensor", "m", _pairs, _MEASURED)
    SENSOR_DELAY = Entry("of the shoulder's and the elbow's reading", "s", 2, _ENVIRONMENT)
    NOMINAL_DELAY = Entry("as declared, whatever the episode has", "s", 1, _ENVIRONMENT)
    NOMINAL_HOLD = Entry("HOLD as declared", "s", 1, _ENVIRONMENT)
    PRESENT_SEGMENT = Entry(
        "side of the path that the reference is on (`entries.Segment`)", "s, m, m/s", SEGMENT_ROWS, _ENVIRONMENT
    )
    DEFLECTION = Entry("of each link's tip", "m", 2, _ENVIRONMENT)
    DEFLECTION_RATE = Entry("its change", "m/s", 2, _ENVIRONMENT)

    JITTER = Entry("largest further delay of a reading", "s", 1, _ENVIRONMENT)
    HOLD = Entry("period of the sensor's own clock; 0: it is continuous", "s", 1, _ENVIRONMENT)
    DROPOUT = Entry("share of the readings that are lost", "1", 1, _ENVIRONMENT)
    OUTAGE = Entry("when it begins, and how long no reading is taken", "s", 2, _ENVIRONMENT)
    ENCODER_NOISE = Entry("standard deviation of encoder angles and rates", "rad, rad/s", 2, _ENVIRONMENT)
    ENCODERS = Entry("joint angles and rates by the encoders", "rad, rad/s", 4, _ENVIRONMENT)
    JOINTS = Entry("those of another engine's arm itself", "rad, rad/s", 4, _HOSTED)
    REFERENCE_JOINTS = Entry(
        "joint angles and rates of the rigid arm on the reference, on the branch of inverse kinematics",
        "rad, rad/s",
        4,
        _ENVIRONMENT,
    )
    MEASURED_SIDE = Entry("side of the elbow by the encoders, as ELBOW_SIDE", "1", 1, _ENVIRONMENT)
    PRESENT_JOINT = Entry("as REFERENCE_JOINTS, with the elbow on MEASURED_SIDE", "rad, rad/s", 4, _ENVIRONMENT)
    LINK_FRAME = Entry("1 for the link's frame, 0 for the world's", "1", 1, _ENVIRONMENT)
    LAP = Entry("time of a lap", "s", 1, _ENVIRONMENT)
    PHASE = Entry("of the lap, 0 to 1", "1", 1, _ENVIRONMENT)
    NEXT_TIME = Entry("how long the next side takes", "s", 1, _ENVIRONMENT)
    NEXT_VELOCITY = Entry("of the reference on the next side", "m/s", 2, _ENVIRONMENT)
    SEGMENT_PASSED = Entry("time since the reference came onto its side, or began to move", "s", 1, _ENVIRONMENT)
    SEGMENT_LEFT = Entry("time until the reference leaves its side", "s", 1, _ENVIRONMENT)
    ACTION_CHANGE = Entry("squared change of the action", "1", 1, _ENVIRONMENT)
    AWAY = Entry("latest path time at which the tip was not near the reference", "s", 1, _ENVIRONMENT)
    SAMPLE_TIME = Entry("when the latest reading was taken", "s", 1, _ENVIRONMENT)
    SAMPLE_AGE = Entry("age of the reading that arrives now; negative: none does", "s", 1, _ENVIRONMENT)
    SAMPLE_POINT = Entry("the reading that arrives now", "m", 2, _ENVIRONMENT)
    READING_AGE = Entry("age of the latest reading", "s", 1, _ENVIRONMENT)
    NOMINAL_TIME = Entry("when it was taken, by the nominal delay", "s", 1, _ENVIRONMENT)
    SAMPLE_REFERENCE = Entry("reference at that time", "m", 2, _ENVIRONMENT)
    SENSOR_ERROR = Entry("reference at that time minus the latest reading", "m", 2, _ENVIRONMENT)
    SENSOR_ERROR_RATE = Entry("its change since the reading before, per second", "m/s", 2, _ENVIRONMENT)
    F_DIRECTIONS = Entry("cosine and sine of theta2, of theta1 (`features`)", "1", 4, _ENVIRONMENT)
    F_JOINT_ERROR = Entry("REFERENCE_JOINTS' angles minus the measured ones", "rad", 2, _ENVIRONMENT)
    F_JOINT_ERROR_RATE = Entry("REFERENCE_JOINTS' rates minus the measured ones", "rad/s", 2, _ENVIRONMENT)
    F_PRESENT_JOINT_ERROR = Entry("PRESENT_JOINT's angles minus the measured ones", "rad", 2, _ENVIRONMENT)
    F_PRESENT_JOINT_ERROR_RATE = Entry("PRESENT_JOINT's rates minus the measured ones", "rad/s", 2, _ENVIRONMENT)
    F_ENCODER_ERROR = Entry("reference minus the tip by rigid kinematics, in the frame", "m", 2, _ENVIRONMENT)
    F_REFERENCE = Entry("reference, in the frame", "m", 2, _ENVIRONMENT)
    F_REFERENCE_VELOCITY = Entry("its velocity, in the frame", "m/s", 2, _ENVIRONMENT)
    F_LINK_SENSOR = Entry("latest reading, in the frame", "m", 2, _ENVIRONMENT)
    F_SENSOR_ERROR = Entry("SENSOR_ERROR, in the frame", "m", 2, _ENVIRONMENT)
    F_SENSOR_ERROR_RATE = Entry("SENSOR_ERROR_RATE, in the frame", "m/s", 2, _ENVIRONMENT)
    END_TORQUE = Entry("torque of the latest step's last stage under the joint-space law", "N m", 2, _FURTHER)
    FURTHER_LINK = Entry("link of each further sensor", "1", lambda s: len(s.sensors), _FURTHER)
    FURTHER_DISTANCE = Entry("of each further sensor from its link's root", "m", lambda s: len(s.sensors), _FURTHER)
    FURTHER_VALUES = Entry("its link's mode shapes there", "m", lambda s: len(s.sensors) * s.modes, _FURTHER)
    FURTHER_SLOPES = Entry("their slopes there", "1", lambda s: len(s.sensors) * s.modes, _FURTHER)
    FURTHER_FORESHORTENING = Entry("foreshortening there", "m", lambda s: len(s.sensors) * s.pairs, _FURTHER)
    FURTHER_DELAY = Entry("of each number that further sensors read", "s", _readings, _FURTHER)
    FURTHER_NOISE = Entry("standard deviation of its noise", "its unit", _readings, _FURTHER)
    FURTHER_DRAW = Entry("place of its noise among a period's random numbers", "1", _readings, _FURTHER)
    FURTHER_BIAS_SPREAD = Entry("standard deviation of its bias", "its unit", _readings, _FURTHER)
    FURTHER_BIAS = Entry("its bias in the present episode", "its unit", _readings, _FURTHER)
    FURTHER_RANGE = Entry("largest magnitude that can be read", "its unit", _readings, _FURTHER)
    NOMINAL_FURTHER_DELAY = Entry("as declared, of each position", "s", lambda s: s.further_points, _FURTHER)
    NOMINAL_FURTHER_DISTANCE = Entry("as declared, of each position", "m", lambda s: s.further_points, _FURTHER)
    FURTHER_ERROR = Entry(
        "points of the rigid arm on the reference, then, minus the positions that were read",
        "m",
        lambda s: 2 * s.further_points,
        _FURTHER,
    )
    F_FURTHER_READING = Entry(
        "positions that further sensors read, in the frame", "m", lambda s: 2 * s.further_points, _FURTHER
    )
    F_FURTHER_ERROR = Entry("FURTHER_ERROR, in the frame", "m", lambda s: 2 * s.further_points, _FURTHER)
    F_PHASE = Entry("cosine and sine of the lap's phase", "1", 2, _ENVIRONMENT)
    FRAME_AXIS = Entry("cosine and sine of the frame's angle", "1", 2, _ENVIRONMENT)

    # what describes an episode (EPISODE to BRANCH), then what is reported (`result_sizes`)
    EPISODE = Entry("what is drawn for the episode (`Drawn`)", "as in `Drawn`", DRAWN_COUNT, _ENVIRONMENT)
    START_TIME = Entry("path time at which the episode started; of a race in m", "s", 1, _ENVIRONMENT)
    BRANCH = Entry("sign of theta2 in inverse kinematics", "1", 1, _ENVIRONMENT)
    STATE = Entry("public state", STATE_UNIT, lambda s: 2 * s.size, _MEASURED)
    TORQUE = Entry("torques at the start of the period; of motors that are not ideal its mean", "N m", 2, _ENVIRONMENT)
    TRUE_TIP = Entry("tip with deflection", "m", 2, _ENVIRONMENT)
    RIGID_TIP = Entry("tip by rigid kinematics", "m", 2, _ENVIRONMENT)
    REFERENCE = Entry("reference position and velocity", "m, m/s", 4, _ENVIRONMENT)
    LINK_SENSOR = Entry("latest reading of the sensor", "m", 2, _ENVIRONMENT)
    FURTHER_READING = Entry("latest readings of the further sensors", "their units", _readings, _FURTHER)
    CARRIED = Entry("payload at the tip", "kg", 1, _PAYLOADS)
    PROGRESS = Entry("way of the reference along the path since the episode began", "m", 1, _RACE)
    REFERENCE_SPEED = Entry("of the period that ended", "m/s", 1, _RACE)
    LAP_TIMES = Entry("time of the first lap, of the fastest, of all; 0: not done", "s", 3, _RACE)
    REWARD_TERMS = Entry("terms of the reward, weighted", "1", lambda s: s.program.reward_terms, _ENVIRONMENT)
    TIME = Entry("since the episode's start", "s", 1, _ENVIRONMENT)
    EFFECTIVE_GAIN = Entry("gain at the start of the period", "1", 1, _ENVIRONMENT)
    TIP_ERROR = Entry("distance of the true tip from the reference", "m", 1, _ENVIRONMENT)
    ELBOW_SIDE = Entry("1 or -1, where the elbow was last bent (`elbow_side`); 0 before", "1", 1, _ENVIRONMENT)
    ELBOW_CHANGES = Entry("how often ELBOW_SIDE has changed since the episode began", "1", 1, _ENVIRONMENT)
    SUCCESS = Entry("whether the tip was near the reference through the final rest", "1", 1, _ENVIRONMENT)
    REWARD = Entry("sum of the reward's terms", "1", 1, _ENVIRONMENT)
    STATUS = Entry("0 for a valid state (`observe.state_status`, `termination_status`)", "1", 1, _ENVIRONMENT)

    TAIL = Entry(
        "previews of the reference, then kept actions, then kept commands unless they are the actions; newest first",
        "m, 1, N m",
        0,
        _ENVIRONMENT,
    )


row = Row()


def sizes_between(rows: dict[str, tuple[int, int]], first: str, last: str) -> dict[str, int]:
    """Return the sizes of the parts of an arena from one to another, in their order."""
    names = list(rows)
    return {name: rows[name][1] for name in names[names.index(first) : names.index(last) + 1]}


def result_sizes(rows: dict[str, tuple[int, int]]) -> dict[str, int]:
    """Return the sizes of what is reported of an arm at an instant, parts that follow each other in its arena."""
    return sizes_between(rows, "STATE", "STATUS")


def arm_rows(k: Constants) -> dict[str, Sequence[float]]:
    """Return the constants of an arm, under the names of the arena's parts, which follow each other."""
    e = elimination(k)
    return {"CONSTANTS": k.flat(), "ELIMINATION": e.flat() if e else []}


def place_rows(name: str, place: PointShape) -> dict[str, Sequence[float]]:
    """Return the arena's parts that describe a point of a link, under the point's name."""
    return {
        f"{name}_DISTANCE": [place.distance],
        f"{name}_VALUES": place.values,
        f"{name}_FORESHORTENING": place.foreshortening,
    }

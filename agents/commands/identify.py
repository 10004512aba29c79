"""`flexarm identify`: parameters of an arm, and delays, from recordings."""

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

from flexarm_agents.commands.arguments import Reader, json_object, of_verb
from flexarm_agents.commands.text import columns
from flexarm_agents.files import check_place, write_json
from flexarm_env.identification import Identified, Recording, identify, parameter_names
from flexarm_env.identification.model import DELAYS
from flexarm_env.identification.recording import COLUMNS
from flexarm_env.parameters import arm_parameters

DESCRIPTION = f"""\
Fit parameters of an arm, and delays, to recorded torques and readings by nonlinear least squares, with intervals of
95 %. A recording is a CSV file with a header: {", ".join(COLUMNS)}. One of joint (encoders, rad), deflection (of a
link's tip off its root tangent, by strain gauges, m) and tip (late sensor, m) is enough; a missing reading is nan."""


def parser() -> Reader:
    """Return the parser of the arguments."""
    reader = of_verb("identify", DESCRIPTION)
    reader.add_argument("runs", nargs="+", type=Path, metavar="RUN", help="recordings with equal periods and channels")
    names = ", ".join(parameter_names())
    reader.add_argument("--fit", nargs="+", required=True, metavar="NAME", help=f"what is fitted: {names}")
    reader.add_argument(
        "--arm", default="default", metavar="ARM", help="name of an arm, or JSON of its fields: start of the search"
    )
    for name in DELAYS:
        option = f"--{name.replace('_', '-')}"
        reader.add_argument(option, type=float, default=0.0, metavar="S", help="known, or where the search begins; 0")
    reader.add_argument("--sensor-position", type=float, metavar="M", help="of the late sensor on link 2; at the tip")
    reader.add_argument("--window", type=float, default=1.0, metavar="S", help="duration that is simulated at once; 1")
    reader.add_argument("--output", type=Path, metavar="JSON", help="write what is found, with the arm, into a file")
    return reader


def run(arguments: Sequence[str]) -> None:
    """Fit, print a table, write a file."""
    given = parser().parse_args(arguments)
    if given.output is not None:
        check_place("output", given.output)
    arm = arm_parameters(json_object(given.arm) if given.arm.startswith("{") else given.arm)
    known = {name: getattr(given, name) for name in (*DELAYS, "sensor_position", "window")}
    found = identify([Recording.load(one) for one in given.runs], arm, given.fit, **known)
    print(table(found))
    if given.output is not None:
        write_json(given.output, found._asdict() | {"arm": asdict(found.arm)})


def table(found: Identified) -> str:
    """Write what was found for a terminal."""
    rows = [["fitted", "value", "95 % from", "to"]]
    rows += [[name, *(f"{x:.6g}" for x in (value, *found.intervals[name]))] for name, value in found.values.items()]
    left = [("channel", "r.m.s. left", "explained")]
    left += [(name, f"{noise:.3g}", f"{100.0 * found.explained[name]:.2f} %") for name, noise in found.noise.items()]
    return f"{columns(rows, right=True)}\n\n{columns(left, right=True)}"

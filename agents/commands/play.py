"""`flexarm play`: a window in which delay, place and gain can be moved while the paper's law runs."""

from collections.abc import Sequence

from flexarm_agents.commands.arguments import Reader, of_verb
from flexarm_agents.viewer.live import ARMS, LEAST_PLACE, MOST_DELAY, MOST_GAIN, Knobs, LiveArm
from flexarm_agents.viewer.window import Viewer
from flexarm_env.envs.window import open_display
from flexarm_env.extras import import_pygame
from flexarm_env.validation import number

DESCRIPTION = """\
Watch the paper's law follow the square on a late sensor, in real time, and move sliders: the sensor's delay, its place
on link 2, and the law's gain. All act at once: the arm keeps its state, and with another delay or place the sensor's
memory begins anew. Drag, or choose by Tab and move by the arrow keys; space pauses, R begins a lap, Esc closes."""


def parser() -> Reader:
    """Return the parser of the arguments."""
    reader = of_verb("play", DESCRIPTION)
    start = Knobs()
    reader.add_argument("--arm", choices=ARMS, default="paper", help="arm; paper")
    delay = f"delay of the sensor at the beginning, 0 to {1e3 * MOST_DELAY:g} ms; {1e3 * start.delay:g}"
    reader.add_argument("--delay", type=float, default=1e3 * start.delay, metavar="MS", help=delay)
    place = f"distance of the sensor from the elbow, from {LEAST_PLACE:g} m to the tip; {start.place:g}"
    reader.add_argument("--place", type=float, default=start.place, metavar="M", help=place)
    gain = f"gain of the law, 0 to {MOST_GAIN:g}; {start.gain:g}"
    reader.add_argument("--gain", type=float, default=start.gain, metavar="X", help=gain)
    return reader


def run(arguments: Sequence[str]) -> None:
    """Open the window."""
    given = parser().parse_args(arguments)
    late = 1e-3 * number("delay", given.delay, "ms", least=0.0, most=1e3 * MOST_DELAY)
    open_display(import_pygame())  # before a kernel is compiled
    Viewer(LiveArm(given.arm, Knobs(late, given.place, given.gain))).run()

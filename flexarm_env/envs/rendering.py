"""`Renderer`: draws a plain `Snapshot` of the arm and its task with pygame; it contains no physics.

Places are given in *units*: a picture of any size has 600 units a side, x to the right and y downwards, with the
shoulder in the middle. Shapes are drawn on a canvas of `SUPERSAMPLING` times the size and averaged down, which smooths
their edges; text is written on the result. pygame is imported when the first picture is drawn.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from flexarm_env.envs.window import Window
from flexarm_env.extras import import_pygame
from flexarm_env.validation import choice, integer

Array = NDArray[np.float64]
Color = tuple[int, int, int]
Point = tuple[float, float]

RENDER_MODES = ("rgb_array", "human")
SIZE_LIMITS = (64, 2048)  # [px]; the canvas of the largest takes 150 MB
SUPERSAMPLING = 3
SIDE = 600.0  # of the picture [unit]
MARGIN = 12.0  # around the reachable disc, and between the picture's border and text [unit]
FAR = 4.0  # coordinates are clipped at this multiple of the reach: a diverging arm must not overflow pygame's integers

# Colour-blind-safe, after Okabe & Ito; as in docs/figures, orange is the true tip and blue what the sensor sees
PAPER: Color = (255, 255, 255)
REACHABLE: Color = (244, 246, 249)
GREY: Color = (142, 148, 158)
TRACK: Color = (220, 224, 230)
INK: Color = (38, 44, 56)
LINKS: tuple[Color, Color] = ((62, 72, 90), (98, 110, 130))
ORANGE: Color = (213, 94, 0)
BLUE: Color = (0, 114, 178)
GREEN: Color = (0, 158, 115)
PURPLE: Color = (170, 85, 140)

# Sizes [unit]
HALO = 1.8  # white rim around a shape
PATH_WIDTH, LINK_WIDTH, TRACE_WIDTH, DASHES_WIDTH = 1.6, 8.0, 2.6, 1.4
HUB_RADIUS, JOINT_RADIUS, PIN_RADIUS = 13.0, 8.0, 3.2
REFERENCE_RADIUS, REFERENCE_WIDTH, RING_CORNERS = 10.5, 2.0, 48
TIP_RADIUS, SENSOR_RADIUS, PAYLOAD_RADIUS = 6.0, 4.5, 15.0
CROSS_SIDE, CROSS_WIDTH = 5.5, 2.0  # larger than the sensor's diamond, which may cover it
DASH, GAP = 4.0, 4.0
TINY = 1e-9
LEGEND_LEFT, ROW = 461.0, 20.0
GAUGE_WIDTH, GAUGE_HEIGHT, CAP_WIDTH, ZERO_WIDTH = 72.0, 9.0, 3.0, 1.5
TORQUE_LEFT, TORQUE_RIGHT, GAIN_LEFT = 80.0, 254.0, 476.0
TEXT_SIZE, TITLE_SIZE = 19.0, 25.0

TRACE_POINTS = 512  # largest number of points that are drawn
FADE_TIME = 2.5  # the trace pales by a factor e in this time [s] ...
FADE_FLOOR = 0.22  # ... down to this share of its colour
LARGE = 1e5  # numbers beyond are written with an exponent


class Snapshot(NamedTuple):
    """Contents of a picture: plain numbers and arrays. What is not finite is left out of the picture."""

    time: float  # since the episode's start [s]
    links: tuple[Array, Array]  # centre lines of the bent links, root to tip [m]. Shape (k, 2) each
    path: Array  # the reference path, closed [m]. Shape (n, 2)
    trace: Array  # the true tip since the episode's start, evenly in time, up to now [m]. Shape (j, 2), j >= 1
    reference: Array  # where the tip should be [m]. Shape (2,)
    sensor: Array  # where the sensor's point is now [m]. Shape (2,)
    sensed: Array  # what its late, noisy measurement says [m]. Shape (2,)
    torque: Array  # shoulder, elbow [N m]. Shape (2,)
    torque_scale: tuple[float, float]  # full deflection of the torques' gauges [N m]
    gain: float | None  # lambda of the inner law; None where the action is something else
    gain_limit: float  # full deflection of its gauge
    reach: float  # of the arm [m]; a disc of this radius fits into the picture
    carries: bool = False  # whether the tip has taken up a payload


class Renderer:
    """Draws snapshots into arrays ("rgb_array", needs no display) or into a window ("human").

    Attributes:
        render_mode: "human" or "rgb_array".
        size: side of the picture [px].
        fps: pictures a second that the window shows at most [1/s].
        dismissed: somebody has closed the window; what is drawn is shown no more until `close`.
    """

    def __init__(self, render_mode: str, size: int = 600, fps: int = 50) -> None:
        """Check the arguments; pygame is imported and a window is opened by `draw` only."""
        self.render_mode = choice("render_mode", render_mode, RENDER_MODES)
        self.size = integer("size", size, *SIZE_LIMITS)
        self.fps = integer("fps", fps, 1)
        self.dismissed = False
        self._canvas: _Canvas | None = None
        self._window: Window | None = None

    def __getstate__(self) -> dict[str, Any]:
        """Leave out pygame's objects, which cannot be copied; a copy makes its own when it draws."""
        return self.__dict__ | {"_canvas": None, "_window": None}

    def draw(self, snapshot: Snapshot) -> NDArray[np.uint8] | None:
        """Draw one picture; the same snapshot gives the same pixels. A window that is paused waits (see `Window`).

        Returns:
            "rgb_array": a new array. Shape (size, size, 3). "human": None; the picture is in the window.

        Raises:
            gymnasium.error.DependencyNotInstalled: if pygame is missing.
            NoDisplayError: "human", and there is no display.
        """
        if self.dismissed:
            return None
        canvas = self._canvas = self._canvas or _Canvas(import_pygame(), self.size)
        canvas.clear()
        _draw_scene(canvas, snapshot)
        _draw_panels(canvas, snapshot)
        picture = canvas.finish()
        if self.render_mode == "human":
            self._show(canvas.pygame, picture)
            return None
        pixels = canvas.pygame.image.tobytes(picture, "RGB")
        return np.frombuffer(pixels, np.uint8).reshape(self.size, self.size, 3).copy()

    def close(self) -> None:
        """Close the window, if there is one; drawing again opens another."""
        if self._window is not None:
            self._window.close()
        self._canvas = self._window = None
        self.dismissed = False

    def _show(self, pygame: Any, picture: Any) -> None:
        if self._window is None or not self._window.alive:
            self._window = Window(pygame, (self.size, self.size))
        self._window.show(picture, self.fps)
        if self._window.closed:
            self._window.close()
            self._window, self.dismissed = None, True


class _Canvas:
    """Smooth shapes and text in units over pygame's surfaces."""

    def __init__(self, pygame: Any, size: int) -> None:
        self.pygame = pygame
        self._size = size
        self._scale = SUPERSAMPLING * size / SIDE  # [px/unit]
        self._surface = pygame.Surface((SUPERSAMPLING * size,) * 2, depth=32)  # depth: no display to take it from
        self._texts: list[tuple[str, Point, float, bool]] = []
        self._fonts: dict[float, Any] = {}

    def clear(self) -> None:
        """Begin a picture."""
        self._surface.fill(PAPER)
        self._texts = []

    def polygon(self, points: Array, color: Color) -> None:
        """Fill a polygon. Shape (n, 2)."""
        self.pygame.draw.polygon(self._surface, color, (points * self._scale).tolist())

    def disc(self, center: Array | Point, radius: float, color: Color) -> None:
        """Fill a disc."""
        x, y = center
        self.pygame.draw.circle(self._surface, color, (x * self._scale, y * self._scale), radius * self._scale)

    def line(self, points: Array, width: float, color: Color | Array) -> None:
        """Draw a polyline with round joints and ends, in one colour or one for each segment. Shape (n, 2)."""
        if len(points) < 2:
            return
        steps = np.diff(points, axis=0)
        lengths = np.maximum(np.hypot(*steps.T), TINY)  # points may be repeated
        across = 0.5 * width * steps[:, ::-1] * [-1.0, 1.0] / lengths[:, None]
        first, last = points[:-1], points[1:]
        quads = self._scale * np.stack([first + across, last + across, last - across, first - across], axis=1)
        colors = np.broadcast_to(color, (len(steps), 3)).tolist()
        self.disc(points[0], 0.5 * width, colors[0])
        for quad, end, one in zip(quads.tolist(), last.tolist(), colors, strict=True):
            self.pygame.draw.polygon(self._surface, one, quad)
            self.disc(end, 0.5 * width, one)

    def box(self, left: float, top: float, width: float, height: float, color: Color) -> None:
        """Fill an upright rectangle."""
        self._surface.fill(color, [round(x * self._scale) for x in (left, top, width, height)])

    def text(self, text: str, at: Point, size: float = TEXT_SIZE, right: bool = False) -> None:
        """Write text over the finished shapes, vertically centred on `at`, its left end or (`right`) its right end."""
        self._texts.append((text, at, size, right))

    def finish(self) -> Any:
        """Average down to the picture's size and write the text. Returns a pygame surface."""
        picture = self.pygame.transform.smoothscale(self._surface, (self._size, self._size))
        scale = self._size / SIDE
        for text, (x, y), size, right in self._texts:
            written = self._write(text, size)
            width, height = written.get_size()
            picture.blit(written, (round(x * scale - right * width), round(y * scale - 0.5 * height)))
        return picture

    def _write(self, text: str, size: float) -> Any:
        try:
            return self._fonts[size].render(text, True, INK)
        except (KeyError, self.pygame.error):  # no such font yet, or another environment called pygame.quit()
            self.pygame.font.init()
            self._fonts[size] = self.pygame.font.Font(None, max(1, round(size * self._size / SIDE)))
            return self._fonts[size].render(text, True, INK)


def _draw_scene(canvas: _Canvas, shot: Snapshot) -> None:
    def place(points: Array) -> Array:
        """Convert metres to units; values that are not finite remain so. Shape (..., 2)."""
        clipped = np.clip(points, -FAR * shot.reach, FAR * shot.reach)
        return 0.5 * SIDE + clipped * [1.0, -1.0] * ((0.5 * SIDE - MARGIN) / shot.reach)

    hub = place(np.zeros(2))
    canvas.disc(hub, 0.5 * SIDE - MARGIN, REACHABLE)
    path = place(shot.path)
    if np.isfinite(path).all():
        canvas.line(np.vstack([path, path[:1]]), PATH_WIDTH, GREY)
    _draw_trace(canvas, place(shot.trace), shot.time)
    _draw_arm(canvas, hub, [place(link) for link in shot.links])
    reference, tip, sensor, sensed = (place(p) for p in (shot.reference, shot.trace[-1], shot.sensor, shot.sensed))
    _draw_dashes(canvas, sensor, sensed)
    for marker, point in (
        *([(_payload, tip)] if shot.carries else []),
        (_tip, tip),
        (_sensed, sensed),
        (_sensor, sensor),
        (_reference, reference),
    ):
        if np.isfinite(point).all():
            marker(canvas, point)


def _draw_trace(canvas: _Canvas, trace: Array, time: float) -> None:
    """Draw where the tip was, the older the paler."""
    # with a power of two, successive pictures show the same points
    stride = 1 << max(0, int(np.ceil(np.log2(len(trace) / TRACE_POINTS))))
    chosen = np.append(np.arange(0, len(trace) - 1, stride), len(trace) - 1)
    ages = max(0.0, time) * (1.0 - chosen / max(len(trace) - 1, 1))
    usable = np.isfinite(trace[chosen]).all(axis=1)
    share = FADE_FLOOR + (1.0 - FADE_FLOOR) * np.exp(-ages[usable][1:, None] / FADE_TIME)
    colors = np.rint(share * ORANGE + (1.0 - share) * REACHABLE)
    canvas.line(trace[chosen][usable], TRACE_WIDTH, colors)


def _draw_arm(canvas: _Canvas, hub: Array, links: list[Array]) -> None:
    for link, color in reversed(list(zip(links, LINKS, strict=True))):
        if np.isfinite(link).all():
            canvas.line(link, LINK_WIDTH + 2.0 * HALO, PAPER)
            canvas.line(link, LINK_WIDTH, color)
    canvas.disc(hub, HUB_RADIUS + HALO, PAPER)
    canvas.disc(hub, HUB_RADIUS, INK)
    for joint in (hub, links[1][0]):
        if np.isfinite(joint).all():
            canvas.disc(joint, JOINT_RADIUS, INK)
            canvas.disc(joint, PIN_RADIUS, PAPER)


def _draw_dashes(canvas: _Canvas, start: Array, end: Array) -> None:
    length = float(np.hypot(*(end - start)))
    if np.isfinite(length) and length > 0.0:
        for begin in np.arange(0.0, length, DASH + GAP):
            piece = np.array([[begin], [min(begin + DASH, length)]]) / length
            canvas.line(start + piece * (end - start), DASHES_WIDTH, BLUE)


def _reference(canvas: _Canvas, at: Array) -> None:
    """Mark where the tip should be: a ring."""
    canvas.line(at + REFERENCE_RADIUS * _corners(RING_CORNERS), REFERENCE_WIDTH, INK)


def _tip(canvas: _Canvas, at: Array) -> None:
    """Mark the true tip: a disc."""
    canvas.disc(at, TIP_RADIUS + HALO, PAPER)
    canvas.disc(at, TIP_RADIUS, ORANGE)


def _payload(canvas: _Canvas, at: Array) -> None:
    """Mark a payload that the tip has taken up: a square around it."""
    canvas.polygon(at + PAYLOAD_RADIUS * _corners(4) @ np.array([[0.5, 0.5], [-0.5, 0.5]]) * 2**0.5, INK)


def _sensor(canvas: _Canvas, at: Array) -> None:
    """Mark the sensor's point: a diamond."""
    canvas.polygon(at + (SENSOR_RADIUS + HALO) * _corners(4), PAPER)
    canvas.polygon(at + SENSOR_RADIUS * _corners(4), BLUE)


def _sensed(canvas: _Canvas, at: Array) -> None:
    """Mark what the sensor says: a cross."""
    for width, color in ((CROSS_WIDTH + HALO, PAPER), (CROSS_WIDTH, BLUE)):
        for stroke in ([[-1.0, -1.0], [1.0, 1.0]], [[-1.0, 1.0], [1.0, -1.0]]):
            canvas.line(at + CROSS_SIDE * np.array(stroke), width, color)


def _corners(count: int) -> Array:
    """Corners of a regular polygon on the unit circle, the first one twice. Shape (count + 1, 2)."""
    turn = np.linspace(0.0, 2.0 * np.pi, count + 1)
    return np.stack([np.cos(turn), np.sin(turn)], axis=1)


def _draw_panels(canvas: _Canvas, shot: Snapshot) -> None:
    """Write time, legend and gauges into the corners, which the arm does not reach."""
    bottom = SIDE - MARGIN - 0.5 * ROW
    canvas.text(f"t = {shot.time:.2f} s", (MARGIN, MARGIN + 0.5 * ROW), TITLE_SIZE)
    entries = ((_reference, "reference"), (_tip, "true tip"), (_sensor, "sensor now"), (_sensed, "its late reading"))
    for row, (marker, text) in enumerate(entries):
        y = MARGIN + (row + 0.5) * ROW
        marker(canvas, np.array([LEGEND_LEFT, y]))
        canvas.text(text, (LEGEND_LEFT + ROW, y))
    for row, (name, full) in enumerate(zip(("shoulder", "elbow"), shot.torque_scale, strict=True)):
        value, y = float(shot.torque[row]), bottom + (row - 1) * ROW
        canvas.text(name, (MARGIN, y))
        _draw_gauge(canvas, TORQUE_LEFT, y, value / full, signed=True)
        canvas.text(f"{_written(value)} N m", (TORQUE_RIGHT, y), right=True)
    if shot.gain is not None:
        canvas.text("gain λ", (GAIN_LEFT - MARGIN, bottom), right=True)
        _draw_gauge(canvas, GAIN_LEFT, bottom, shot.gain / shot.gain_limit, signed=False)
        canvas.text(f"{shot.gain:.2f}", (SIDE - MARGIN, bottom), right=True)


def _draw_gauge(canvas: _Canvas, left: float, y: float, ratio: float, signed: bool) -> None:
    """Draw a bar from its zero (middle if signed, else left) to ratio 1 at most; a dark cap marks larger ratios."""
    top, length = y - 0.5 * GAUGE_HEIGHT, GAUGE_WIDTH * (0.5 if signed else 1.0)
    zero = left + GAUGE_WIDTH - length
    canvas.box(left, top, GAUGE_WIDTH, GAUGE_HEIGHT, TRACK)
    if not np.isnan(ratio):
        end = zero + length * float(np.clip(ratio, -1.0 if signed else 0.0, 1.0))
        canvas.box(min(zero, end), top, abs(end - zero), GAUGE_HEIGHT, GREEN if signed else PURPLE)
        if abs(ratio) > 1.0:
            canvas.box(end - CAP_WIDTH * (ratio > 0.0), top, CAP_WIDTH, GAUGE_HEIGHT, INK)
    canvas.box(zero - 0.5 * ZERO_WIDTH, top - ZERO_WIDTH, ZERO_WIDTH, GAUGE_HEIGHT + 2.0 * ZERO_WIDTH, INK)


def _written(value: float) -> str:
    return f"{value:+.1f}" if abs(value) < LARGE or not np.isfinite(value) else f"{value:+.1e}"

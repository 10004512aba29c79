"""`Viewer`: a window with the arm that runs, and sliders for delay and place of its sensor and for the law's gain."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from flexarm_agents.viewer.live import LEAST_PLACE, MEMORY, MOST_DELAY, MOST_GAIN, LiveArm
from flexarm_env.envs.rendering import BLUE, GREY, INK, ORANGE, PAPER, PURPLE, TRACK, Color
from flexarm_env.envs.window import Window
from flexarm_env.extras import import_pygame

SIDE = 600  # of the arm's picture [px]
LEFT, RIGHT = SIDE + 30, SIDE + 330  # of what stands beside it [px]
SIZE = (RIGHT + 30, SIDE)
FPS = 25
TITLE_SIZE, TEXT_SIZE, SMALL_SIZE = 29, 22, 18  # [px]
FIRST, APART = 105, 76  # of the sliders: the first one's height and the distance between two [px]
KNOB, BAR = 9, 4  # radius and thickness of a slider [px]
CHART_TOP, CHART_HEIGHT = 355, 110  # [px]
CHART_LEAST = 0.5  # full height of the chart at least [m]
KEYS = ("drag, or Tab and the arrow keys", "space pauses, R begins a lap", "Esc closes")


@dataclass
class Slider:
    """A knob on the screen."""

    name: str  # of the knob
    text: str
    unit: str  # in which it is shown
    scale: float  # from the knob's unit, that of `least`, `most` and `step`, to that one
    least: float
    most: float
    step: float  # of the arrow keys
    color: Color
    y: int  # height of its line [px]

    def place(self, value: float) -> float:
        """Return where a value is [px]."""
        return LEFT + (RIGHT - LEFT) * (value - self.least) / (self.most - self.least)

    def value(self, x: float) -> float:
        """Return the value at a place, to the arrow keys' step."""
        free = self.least + (self.most - self.least) * (x - LEFT) / (RIGHT - LEFT)
        return self.limited(self.least + round((free - self.least) / self.step) * self.step)

    def limited(self, value: float) -> float:
        """Return a value within the range."""
        return min(max(value, self.least), self.most)

    def hit(self, x: float, y: float) -> bool:
        """Whether a point of the screen is on it."""
        return abs(y - self.y) <= 2 * KNOB and LEFT - 2 * KNOB <= x <= RIGHT + 2 * KNOB


class Viewer:
    """The window; the arrow keys move the slider that is chosen."""

    def __init__(self, live: LiveArm) -> None:
        self._pygame = import_pygame()
        self.live, self.chosen = live, 0
        self.window = Window(self._pygame, SIZE, steps=False)
        rows = [
            ("delay", "delay of the sensor", "ms", 1e3, 0.0, MOST_DELAY, 1e-3, BLUE),
            ("place", "sensor, from the elbow", "m", 1.0, LEAST_PLACE, live.longest, 0.1, ORANGE),
            ("gain", "gain λ of the law", "", 1.0, 0.0, MOST_GAIN, 0.05, PURPLE),
        ]
        self.sliders = [Slider(*row, FIRST + n * APART) for n, row in enumerate(rows)]
        self._held: Slider | None = None
        self._pygame.font.init()
        self._fonts = {size: self._pygame.font.Font(None, size) for size in (TITLE_SIZE, TEXT_SIZE, SMALL_SIZE)}
        self._surface = self._pygame.Surface(SIZE)

    def run(self) -> None:
        """Show the arm in real time until the window is closed."""
        while not self.window.closed:
            self.frame()
        self.window.close()
        self.live.close()

    def frame(self) -> None:
        """Handle the events, run the arm for the time of a picture, and show it."""
        for event in self.window.look():
            self._handle(event)
        if self.window.closed:
            return
        if not self.window.paused:
            self.live.advance(round(1.0 / FPS / self.live.period))
        self._draw()
        self.window.put(self._surface, FPS)

    # --- input -----------------------------------------------------------------------------------------------------

    def _handle(self, event: Any) -> None:
        pygame = self._pygame
        if event.type == pygame.KEYDOWN:
            self._press(event.key)
        elif event.type == pygame.MOUSEBUTTONDOWN and event.button == 1:
            self._held = next((one for one in self.sliders if one.hit(*event.pos)), None)
            if self._held is not None:
                self.chosen = self.sliders.index(self._held)
                self._turn(self._held, self._held.value(event.pos[0]))
        elif event.type == pygame.MOUSEMOTION and self._held is not None:
            self._turn(self._held, self._held.value(event.pos[0]))
        elif event.type == pygame.MOUSEBUTTONUP:
            self._held = None

    def _press(self, key: int) -> None:
        pygame = self._pygame
        slider = self.sliders[self.chosen]
        if key in (pygame.K_TAB, pygame.K_DOWN):
            self.chosen = (self.chosen + 1) % len(self.sliders)
        elif key == pygame.K_UP:
            self.chosen = (self.chosen - 1) % len(self.sliders)
        elif key in (pygame.K_LEFT, pygame.K_RIGHT):
            step = slider.step if key == pygame.K_RIGHT else -slider.step
            self._turn(slider, slider.limited(round(getattr(self.live.knobs, slider.name) + step, 9)))
        elif key == pygame.K_r:
            self.live.restart()

    def _turn(self, slider: Slider, value: float) -> None:
        if value != getattr(self.live.knobs, slider.name):
            self.live.turn(**{slider.name: value})

    # --- the picture -----------------------------------------------------------------------------------------------

    def _draw(self) -> None:
        pygame = self._pygame
        self._surface.fill(PAPER)
        self._surface.blit(pygame.surfarray.make_surface(self.live.picture().swapaxes(0, 1)), (0, 0))
        self._write("A late sensor on a flexible arm", LEFT, 28, TITLE_SIZE)
        for n, slider in enumerate(self.sliders):
            self._draw_slider(slider, n == self.chosen)
        self._draw_chart()
        status = "paused" if self.window.paused else f"lap at {self.live.phase:.1f} s"
        if self.live.ended is not None:
            status = f"lost ({self.live.ended}): press R"
        self._write(status, LEFT, 505, TEXT_SIZE, ORANGE if self.live.ended else INK)
        for n, line in enumerate(KEYS):
            self._write(line, LEFT, 535 + 18 * n, SMALL_SIZE, GREY)

    def _draw_slider(self, slider: Slider, chosen: bool) -> None:
        pygame, value = self._pygame, getattr(self.live.knobs, slider.name)
        x = slider.place(value)
        self._write(slider.text, LEFT, slider.y - 34, TEXT_SIZE)
        shown = f"{value * slider.scale:.{0 if slider.unit == 'ms' else 2}f} {slider.unit}".rstrip()
        self._write(shown, RIGHT, slider.y - 34, TEXT_SIZE, right=True)
        for color, end in ((TRACK, RIGHT), (slider.color, x)):
            pygame.draw.rect(self._surface, color, (LEFT, slider.y - BAR // 2, end - LEFT, BAR), border_radius=BAR // 2)
        if chosen:
            pygame.draw.aacircle(self._surface, TRACK, (x, slider.y), KNOB + 5)
        pygame.draw.aacircle(self._surface, slider.color, (x, slider.y), KNOB)
        pygame.draw.aacircle(self._surface, PAPER, (x, slider.y), KNOB // 2)

    def _draw_chart(self) -> None:
        errors = np.nan_to_num(np.array(self.live.errors), posinf=1e3)
        top, bottom = max(CHART_LEAST, float(errors.max())), CHART_TOP + CHART_HEIGHT
        self._write("distance of the tip from the reference", LEFT, CHART_TOP - 26, SMALL_SIZE)
        self._write(f"{errors[-1]:.2f} m", RIGHT, CHART_TOP - 26, SMALL_SIZE, ORANGE, right=True)
        self._pygame.draw.line(self._surface, TRACK, (LEFT, bottom), (RIGHT, bottom), 2)
        count = self.live.errors.maxlen or len(errors)
        x = RIGHT - (RIGHT - LEFT) * np.arange(len(errors) - 1, -1, -1) / (count - 1)
        y = bottom - CHART_HEIGHT * errors / top
        if len(errors) > 1:
            self._pygame.draw.aalines(self._surface, ORANGE, False, np.stack([x, y], axis=1).tolist())
        self._write(f"{MEMORY:.0f} s ago", LEFT, bottom + 5, SMALL_SIZE, GREY)
        self._write("now", RIGHT, bottom + 5, SMALL_SIZE, GREY, right=True)

    def _write(self, text: str, x: float, y: float, size: int, color: Color = INK, right: bool = False) -> None:
        written = self._fonts[size].render(text, True, color)
        self._surface.blit(written, (x - right * written.get_width(), y))

"""`Window`: shows pictures, keeps their pace, and can be paused and closed by whoever looks at it.

The space bar pauses and goes on, the right arrow shows one picture more while it is paused; Escape, Q and the window's
own button close it.
"""

from __future__ import annotations

import os
from typing import Any

TITLE = "FlexArm"
HINT = "paused: space goes on, right arrow steps, Esc closes"
HINT_SIZE = 1.0 / 30.0  # of its letters, as a share of the window's width
HINT_PLACE = 0.88  # of its upper edge, as a share of the window's height: above the gauges
PATIENCE = 50  # between two looks at the keys while paused [ms]
DRIVER_CHOICES = ("SDL_VIDEODRIVER", "SDL_VIDEO_DRIVER")  # of the environment: SDL 2 and 3
UNSEEN = ("offscreen", "dummy")  # drivers of SDL that show nothing; it takes the first itself if there is no display


class NoDisplayError(OSError):
    """There is no display on which a window could be seen."""


def open_display(pygame: Any) -> None:
    """Connect to the display, with the driver that the environment chooses, if it chooses one.

    Raises:
        NoDisplayError: there is none.
    """
    chosen = any(map(os.environ.get, DRIVER_CHOICES))
    why = ""
    try:
        pygame.display.init()
        if chosen or pygame.display.get_driver() not in UNSEEN:
            return
        pygame.display.quit()
    except pygame.error as error:
        why = f" ({error})"
    raise NoDisplayError(
        f"there is no display for a window{why}; write a file, by `flexarm replay --output` or "
        "`flexarm render --output`, or draw arrays, by render_mode='rgb_array'"
    )


class Window:
    """A window.

    Attributes:
        paused: no further picture is shown until somebody lets it go on.
        closed: somebody has closed it; it shows nothing more.
    """

    def __init__(self, pygame: Any, size: tuple[int, int], steps: bool = True) -> None:
        """Open a window of a width and height [px]; `steps`: the right arrow shows one picture more while it is paused.

        Raises:
            NoDisplayError: there is no display.
        """
        self.paused = self.closed = False
        self._steps = steps
        self._pygame = pygame
        self._once = False
        open_display(pygame)
        self._surface = pygame.display.set_mode(size)
        pygame.display.set_caption(TITLE)
        self._clock = pygame.time.Clock()

    @property
    def alive(self) -> bool:
        """Whether pygame still has it; another environment may have closed all windows."""
        return self._pygame.display.get_surface() is not None

    def show(self, picture: Any, fps: int) -> None:
        """Show a picture, no sooner than 1 / fps after the last; while it is paused, wait.

        Args:
            picture: a surface of the window's size.
            fps: pictures a second, at most.
        """
        self.put(picture, fps)
        self.look()
        while self.paused and not self._once and not self.closed:
            self._write_hint()
            self._pygame.time.wait(PATIENCE)
            self.look()
        self._once = False

    def put(self, picture: Any, fps: int) -> None:
        """Show a picture, no sooner than 1 / fps after the last, paused or not; arguments as of `show`."""
        self._surface.blit(picture, (0, 0))
        self._clock.tick(fps)
        self._pygame.display.flip()

    def look(self) -> list[Any]:
        """Read the keys that were pressed and whether the window was closed; return all other events."""
        pygame = self._pygame
        rest = []
        for event in pygame.event.get():
            key = event.key if event.type == pygame.KEYDOWN else None
            if event.type == pygame.QUIT or key in (pygame.K_ESCAPE, pygame.K_q):
                self.closed = True
            elif key == pygame.K_SPACE:
                self.paused = not self.paused
            elif key == pygame.K_RIGHT and self.paused and self._steps:
                self._once = True
            else:
                rest.append(event)
        return rest

    def close(self) -> None:
        """Close the window."""
        self._pygame.display.quit()

    def _write_hint(self) -> None:
        pygame = self._pygame
        pygame.font.init()
        width, height = self._surface.get_size()
        font = pygame.font.Font(None, round(HINT_SIZE * width))
        text = font.render(HINT, True, (255, 255, 255), (38, 44, 56))
        self._surface.blit(text, ((width - text.get_width()) // 2, round(HINT_PLACE * height)))
        pygame.display.flip()

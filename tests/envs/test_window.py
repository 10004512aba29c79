"""`Window`: keys that pause, step and close it."""

import itertools
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any
from unittest.mock import patch

import numpy as np
import pytest

from flexarm_agents.commands import main
from flexarm_env.envs.rendering import Renderer
from flexarm_env.envs.window import DRIVER_CHOICES, NoDisplayError
from tests.envs.test_rendering import SCENE, SIZE


def press(pygame: Any, *keys: int) -> None:
    for key in keys:
        pygame.event.post(pygame.event.Event(pygame.KEYDOWN, key=key))


def picture(pygame: Any) -> np.ndarray:
    return np.asarray(pygame.surfarray.array3d(pygame.display.get_surface()))


@contextmanager
def pausing(pygame: Any, act: Callable[[int], None], size: int = SIZE) -> Iterator[Renderer]:
    """Make a window, and pause it after its first picture; the n-th look at the keys, in place of a wait, acts."""
    window, looks = Renderer("human", size, fps=1000), itertools.count(1)
    window.draw(SCENE)
    with patch.object(pygame.time, "wait", lambda time: act(next(looks))):
        press(pygame, pygame.K_SPACE)
        yield window
    window.close()


def test_the_space_bar_pauses_and_goes_on(pygame: Any) -> None:
    pictures = []

    def act(look: int) -> None:
        pictures.append(picture(pygame))
        if look == 3:
            press(pygame, pygame.K_SPACE)

    with pausing(pygame, act) as window:
        before = picture(pygame)
        for _ in range(2):
            window.draw(SCENE)
            assert len(pictures) == 3
        assert (pictures[0] != before).any()  # it says that it is paused
        np.testing.assert_array_equal(picture(pygame), before)


@pytest.mark.parametrize("size", [200, 600])
def test_the_hint_of_a_paused_window_covers_no_gauge(pygame: Any, size: int) -> None:
    pictures = []

    def act(look: int) -> None:
        pictures.append(picture(pygame))
        press(pygame, pygame.K_SPACE)

    with pausing(pygame, act, size) as window:
        before = picture(pygame)
        window.draw(SCENE)
    changed = (pictures[0] != before).any(axis=2)  # the pixels that the hint takes
    (across, down) = (np.flatnonzero(changed.any(axis=axis)) for axis in (1, 0))
    assert across.min() > 0.1 * size
    assert across.max() < 0.9 * size  # the whole text is in the window
    assert down.min() > 0.85 * size  # below the path
    assert down.max() < 0.91 * size  # above the gauges
    assert changed[across.min() : across.max(), down.min() : down.max()].mean() > 0.9


def test_a_paused_window_steps(pygame: Any) -> None:
    looks: list[int] = []

    def act(look: int) -> None:
        looks.append(look)
        press(pygame, pygame.K_RIGHT)

    with pausing(pygame, act) as window:
        for n in (1, 2, 3):
            window.draw(SCENE)
            assert len(looks) == n  # it is paused again after each picture
        press(pygame, pygame.K_ESCAPE)
        window.draw(SCENE)


@pytest.mark.parametrize("how", ["escape", "q", "button"])
def test_a_window_that_is_closed_stays_closed(pygame: Any, how: str) -> None:
    window = Renderer("human", 64, fps=1000)
    window.draw(SCENE)
    if how == "button":
        pygame.event.post(pygame.event.Event(pygame.QUIT))
    else:
        press(pygame, pygame.K_SPACE, {"escape": pygame.K_ESCAPE, "q": pygame.K_q}[how])  # paused, too
    window.draw(SCENE)
    assert window.dismissed
    assert not pygame.display.get_init()
    window.draw(SCENE)
    assert not pygame.display.get_init()
    window.close()
    window.draw(SCENE)
    assert pygame.display.get_init()
    window.close()


@pytest.fixture
def no_display(monkeypatch: pytest.MonkeyPatch) -> None:
    if sys.platform != "linux":
        pytest.skip("always has a display")
    for name in (*DRIVER_CHOICES, "DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)


@pytest.mark.usefixtures("no_display")
@pytest.mark.parametrize("driver", ["", "x11"])
def test_without_a_display_no_window_opens_and_a_driver_is_named(driver: str, monkeypatch: pytest.MonkeyPatch) -> None:
    pygame = pytest.importorskip("pygame")
    pygame.display.quit()
    if driver:
        monkeypatch.setenv("SDL_VIDEODRIVER", driver)
    with pytest.raises(NoDisplayError, match=driver or None):
        Renderer("human", SIZE).draw(SCENE)
    assert not pygame.display.get_init()


@pytest.mark.usefixtures("no_display")
@pytest.mark.parametrize("verb", [["play"], ["replay", "run.npz"], ["render", "square"]])
def test_a_verb_ends_at_once_without_a_display(verb: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("pygame").display.quit()
    with pytest.raises(SystemExit) as ended:
        main(verb)
    assert ended.value.code == 1
    assert "--output" in capsys.readouterr().err

"""`LiveArm` and `Viewer`: knobs that are turned while the arm runs."""

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from flexarm_agents.commands import main
from flexarm_agents.viewer.live import MOST_DELAY, Knobs, LiveArm
from flexarm_agents.viewer.window import FPS, SIDE, SIZE, Viewer
from tests.support.refusals import refuses


@pytest.fixture
def live() -> Iterator[LiveArm]:
    arm = LiveArm()
    yield arm
    arm.close()


@pytest.fixture
def viewer(live: LiveArm, monkeypatch: pytest.MonkeyPatch) -> Iterator[Viewer]:
    pytest.importorskip("pygame")
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    opened = Viewer(live)
    yield opened
    opened.window.close()


def state(live: LiveArm) -> Any:
    return live._info["state"]


def test_untouched_it_is_the_environment(live: LiveArm) -> None:
    env = live._make()
    env.reset(seed=0, options={"parameters": {"delay": live.knobs.delay}})
    live.advance(50)
    for _ in range(50):
        info = env.step(np.array([live.knobs.gain - 1.0], np.float32))[-1]
    np.testing.assert_array_equal(state(live), info["state"])
    assert len(live.errors) == 51
    assert live.errors[-1] == np.hypot(*(info["true_tip"] - info["reference"][:2]))


@pytest.mark.parametrize("changes", [{"delay": 0.1}, {"place": 2.0}, {"delay": 0.0, "place": 0.5}])
def test_the_sensor_is_moved_at_once_and_the_arm_stays(live: LiveArm, changes: dict[str, float]) -> None:
    live.advance(150)
    before, phase = state(live).copy(), live.phase
    live.turn(**changes)
    np.testing.assert_allclose(state(live), before, rtol=0.0, atol=1e-12)
    assert live.phase == phase == pytest.approx(1.5)
    np.testing.assert_allclose(live._info["time"], 0.0)
    assert live._env.episode.parameters["delay"] == live.knobs.delay
    assert live._env.settings.sensor_position == live.knobs.place
    live.advance(1)
    assert live.phase == pytest.approx(1.51)


def test_the_gain_is_the_action(live: LiveArm) -> None:
    live.turn(gain=1.5)
    live.advance(1)
    assert live._info["gain"] == 1.5


def test_a_late_sensor_loses_the_arm_and_a_lap_begins_anew(live: LiveArm) -> None:
    live.turn(delay=MOST_DELAY)
    live.advance(1600)
    assert live.ended == "error"
    live.turn(delay=0.0, place=2.0)  # waits for the next lap
    live.advance(10)
    assert live.ended == "error"
    live.restart()
    assert live._env.settings.sensor_position == 2.0
    live.advance(10)
    assert live.ended is None
    assert live._env.episode.parameters["delay"] == 0.0


@pytest.mark.parametrize("changes", [{"delay": 0.3}, {"place": 0.0}, {"place": 5.0}, {"gain": 2.1}, {"gain": np.nan}])
def test_bad_knobs_are_refused(live: LiveArm, changes: dict[str, float]) -> None:
    (name,) = changes
    with refuses(ValueError, f"{name} = "):
        live.turn(**changes)
    assert live.knobs == Knobs()


def post(viewer: Viewer, kind: str, **values: Any) -> None:
    pygame = viewer._pygame
    pygame.event.post(pygame.event.Event(getattr(pygame, kind), **values))


def press(viewer: Viewer, *names: str) -> None:
    for name in names:
        post(viewer, "KEYDOWN", key=getattr(viewer._pygame, f"K_{name}"))
    viewer.frame()


def test_keys_choose_and_move_sliders(viewer: Viewer) -> None:
    press(viewer, "RIGHT", "RIGHT")
    assert viewer.live.knobs.delay == pytest.approx(0.032)
    press(viewer, "TAB", "LEFT")
    assert viewer.live.knobs.place == pytest.approx(4.4)
    press(viewer, "UP", "UP", "RIGHT")
    assert viewer.live.knobs.gain == pytest.approx(1.05)
    press(viewer, *["RIGHT"] * 30)
    assert viewer.live.knobs.gain == 2.0


def test_sliders_are_dragged(viewer: Viewer) -> None:
    slider = viewer.sliders[0]
    post(viewer, "MOUSEBUTTONDOWN", button=1, pos=(slider.place(0.03), slider.y))
    post(viewer, "MOUSEMOTION", pos=(slider.place(0.08), 20), rel=(0, 0), buttons=(1, 0, 0))
    post(viewer, "MOUSEBUTTONUP", button=1, pos=(0, 0))
    post(viewer, "MOUSEMOTION", pos=(slider.place(0.01), slider.y), rel=(0, 0), buttons=(0, 0, 0))
    viewer.frame()
    assert viewer.live.knobs == Knobs(delay=pytest.approx(0.08))
    post(viewer, "MOUSEBUTTONDOWN", button=1, pos=(9999, slider.y))  # beside it
    viewer.frame()
    assert viewer.live.knobs.delay == pytest.approx(0.08)


def test_it_runs_in_real_time_pauses_and_begins_anew(viewer: Viewer) -> None:
    viewer.frame()
    assert viewer.live.phase == pytest.approx(1.0 / FPS)
    press(viewer, "SPACE")
    press(viewer, "RIGHT")  # moves the slider, not the time
    assert viewer.live.phase == pytest.approx(1.0 / FPS)
    assert viewer.live.knobs.delay == pytest.approx(0.031)
    press(viewer, "SPACE")
    assert viewer.live.phase == pytest.approx(2.0 / FPS)
    press(viewer, "SPACE", "r")
    assert viewer.live.phase == 0.0


def test_the_picture_has_the_arm_and_the_sliders(viewer: Viewer) -> None:
    viewer.frame()
    shown = viewer._pygame.surfarray.array3d(viewer._pygame.display.get_surface()).swapaxes(0, 1)
    assert shown.shape == (SIZE[1], SIZE[0], 3)
    np.testing.assert_array_equal(shown[:, :SIDE], viewer.live.picture())
    for slider in viewer.sliders:
        x = round(slider.place(getattr(viewer.live.knobs, slider.name))) - 7
        assert tuple(shown[slider.y, x]) == slider.color


def test_the_verb_ends_when_the_window_is_closed(monkeypatch: pytest.MonkeyPatch) -> None:
    pygame = pytest.importorskip("pygame")
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    frames: list[Viewer] = []
    original = Viewer.frame

    def frame(self: Viewer) -> None:
        frames.append(self)
        if len(frames) == 3:
            pygame.event.post(pygame.event.Event(pygame.QUIT))
        original(self)

    monkeypatch.setattr(Viewer, "frame", frame)
    main(["play", "--delay", "60", "--gain", "0.5", "--arm", "paper"])
    assert len(frames) == 3
    assert frames[0].live.knobs == Knobs(delay=0.06, gain=0.5)
    assert not pygame.display.get_init()

"""`LiveArm` and `Viewer`: knobs that are turned while the arm runs; `Film`: recorded runs as pictures."""

import sys
from collections.abc import Iterator
from dataclasses import replace
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tqdm import tqdm

from flexarm_agents.commands import main, render, replay
from flexarm_agents.viewer.film import SENSOR, Film
from flexarm_agents.viewer.live import MOST_DELAY, Knobs, LiveArm
from flexarm_agents.viewer.window import FPS, SIDE, SIZE, Viewer
from flexarm_env import ArmParameters, FlexibleArm, Trajectory
from tests.support.refusals import refuses
from tests.support.shell import Shell

pygame = pytest.importorskip("pygame")


@pytest.fixture(autouse=True)
def unseen(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let windows open on a display that nobody sees."""
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")


@pytest.fixture
def live() -> Iterator[LiveArm]:
    arm = LiveArm()
    yield arm
    arm.close()


@pytest.fixture
def viewer(live: LiveArm) -> Iterator[Viewer]:
    opened = Viewer(live)
    yield opened
    opened.window.close()


def state(live: LiveArm) -> Any:
    return live._info["state"]


def test_untouched_it_is_the_environment_and_the_gain_is_the_action(live: LiveArm) -> None:
    env = live._make()
    env.reset(seed=0, options={"parameters": {"delay": live.knobs.delay}})
    live.advance(50)
    for _ in range(50):
        info = env.step(np.array([live.knobs.gain - 1.0], np.float32))[-1]
    np.testing.assert_array_equal(state(live), info["state"])
    assert len(live.errors) == 51
    assert live.errors[-1] == np.hypot(*(info["true_tip"] - info["reference"][:2]))
    live.turn(gain=1.5)
    live.advance(1)
    assert live._info["gain"] == 1.5


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


def post(kind: str, **values: Any) -> None:
    pygame.event.post(pygame.event.Event(getattr(pygame, kind), **values))


def press(viewer: Viewer, *names: str) -> None:
    for name in names:
        post("KEYDOWN", key=getattr(pygame, f"K_{name}"))
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
    post("MOUSEBUTTONDOWN", button=1, pos=(slider.place(0.03), slider.y))
    post("MOUSEMOTION", pos=(slider.place(0.08), 20), rel=(0, 0), buttons=(1, 0, 0))
    post("MOUSEBUTTONUP", button=1, pos=(0, 0))
    post("MOUSEMOTION", pos=(slider.place(0.01), slider.y), rel=(0, 0), buttons=(0, 0, 0))
    viewer.frame()
    assert viewer.live.knobs == Knobs(delay=pytest.approx(0.08))
    post("MOUSEBUTTONDOWN", button=1, pos=(9999, slider.y))  # beside it
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
    shown = pygame.surfarray.array3d(pygame.display.get_surface()).swapaxes(0, 1)
    assert shown.shape == (SIZE[1], SIZE[0], 3)
    np.testing.assert_array_equal(shown[:, :SIDE], viewer.live.picture())
    for slider in viewer.sliders:
        x = round(slider.place(getattr(viewer.live.knobs, slider.name))) - 7
        assert tuple(shown[slider.y, x]) == slider.color


def test_the_verb_ends_when_the_window_is_closed(monkeypatch: pytest.MonkeyPatch) -> None:
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


# --- recorded runs as pictures: `Film`, and the verbs `render` and `replay` ------------------------------------------


PIXELS = 64


@pytest.fixture
def run() -> Trajectory:
    """Half a second of an arm that turns."""
    arm = FlexibleArm(ArmParameters.linear())
    time = 0.01 * np.arange(51)
    state = np.zeros((51, 12))
    state[:, 0] = time
    found = arm.record(time, state, np.ones((51, 2)), reference=np.full((51, 2), 4.0), sensed=np.ones((51, 2)))
    return replace(found, notes={SENSOR: 4.0, "ended": "truncated"})


@pytest.mark.parametrize(
    ("fps", "speed", "instants"),
    [(10, 1.0, [0, 10, 20, 30, 40, 50]), (10, 2.5, [0, 25, 50]), (4, 0.5, [0, 13, 25, 38, 50]), (1, 100.0, [0])],
)
def test_pictures_are_evenly_in_time(run: Trajectory, fps: int, speed: float, instants: list[int]) -> None:
    film = Film(run, fps, speed, PIXELS)
    assert film.instants() == instants
    assert len(film) == len(instants)


def test_a_picture_shows_its_instant(run: Trajectory) -> None:
    shot = Film(run).snapshot(30)
    assert shot.time == run.time[30]
    np.testing.assert_allclose(shot.links[1][-1], run.tip[30], atol=1e-12)
    np.testing.assert_allclose(np.hypot(*(shot.sensor - run.elbow[30])), 4.0)
    np.testing.assert_array_equal(shot.trace, run.tip[:31])
    assert shot.gain is None
    bare = Film(replace(run, reference=None, sensed=None, gain=np.full(51, 2.0), notes={})).snapshot(0)
    assert np.isnan([*bare.reference, *bare.sensed, *bare.sensor]).all()
    assert (bare.gain, bare.gain_limit) == (2.0, 2.0)


def test_a_png_shows_one_moment(run: Trajectory, tmp_path: Path) -> None:
    film = Film(run, size=PIXELS)
    for name, time in (("last.png", None), ("same.png", 0.5), ("first.png", 0.0)):
        film.write(tmp_path / "folder" / name, time)
    last, same, first = (
        pygame.surfarray.array3d(pygame.image.load(tmp_path / "folder" / f"{name}.png"))
        for name in ("last", "same", "first")
    )
    assert last.shape == (PIXELS, PIXELS, 3)
    np.testing.assert_array_equal(last, same)
    assert (last != first).any()


def test_a_gif_moves(run: Trajectory, tmp_path: Path) -> None:
    image = pytest.importorskip("PIL.Image")
    ticks: list[int] = []
    Film(run, 10, 1.0, PIXELS).write(tmp_path / "run.gif", tick=lambda: ticks.append(1))
    with image.open(tmp_path / "run.gif") as found:
        assert (found.n_frames, found.size, found.info["duration"]) == (6, (PIXELS, PIXELS), 100)
    assert len(ticks) == 6
    assert [path.name for path in tmp_path.iterdir()] == ["run.gif"]


def test_an_mp4_is_written(run: Trajectory, tmp_path: Path) -> None:
    pytest.importorskip("moviepy")
    Film(run, 10, 1.0, PIXELS + 1).write(tmp_path / "run.mp4")
    assert (tmp_path / "run.mp4").read_bytes()[4:8] == b"ftyp"


def test_what_writes_files_is_named(run: Trajectory, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "PIL", None)
    with refuses(ModuleNotFoundError, "gif: PIL is not installed", "[video]"):
        Film(run, 10, 1.0, PIXELS).write(tmp_path / "run.gif")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"time": np.full(51, np.nan)}, "time: must be finite"),
        ({"time": -0.01 * np.arange(51)}, "time: must be finite, and must not run backwards"),
        ({"time": 1e6 * np.arange(51)}, "at most 100000"),
        ({"notes": {SENSOR: "x"}}, "sensor_position = 'x'"),
    ],
)
def test_runs_of_strangers(run: Trajectory, changes: dict[str, Any], words: str) -> None:
    with pytest.raises((TypeError, ValueError), match=words):
        Film(replace(run, **changes))


def test_runs_with_wild_numbers_are_shown(run: Trajectory, tmp_path: Path) -> None:
    wild = {name: np.full_like(getattr(run, name), bad) for name, bad in (("state", np.inf), ("torque", np.nan))}
    Film(replace(run, **wild), size=PIXELS).write(tmp_path / "run.png")
    assert (tmp_path / "run.png").exists()


def test_replay_opens_a_window(run: Trajectory, flexarm: Shell) -> None:
    run.save("run.npz")
    flexarm("replay", "run.npz", "--fps", "100", "--size", PIXELS, "--speed", "10")
    assert not pygame.display.get_init()


def test_render_runs_an_episode_that_replay_shows_again(flexarm: Shell, monkeypatch: pytest.MonkeyPatch) -> None:
    bars: list[tqdm[Any]] = []

    def bar(total: int, unit: str) -> Any:
        bars.append(tqdm(total=total, file=StringIO()))
        return bars[-1]

    for module in (render, replay):
        monkeypatch.setattr(module, "progress_bar", bar)
    saved, one, other = (flexarm.folder / name for name in ("lap.npz", "one.png", "other.png"))
    ended = flexarm("render", "joint_pd", "--lap", "plain", "--save", saved, "--output", one, "--size", PIXELS)
    assert ended.stdout.startswith("joint_pd: plain lap, complete\n")
    assert [(one.n, one.total) for one in bars] == [(1600, 1600), (1, 1)]  # of the episode, and the picture
    assert Trajectory.load(saved).notes == {
        "ended": "truncated", "policy": "joint_pd", "environment": "FlexArm/Square-v0", "lap": "plain", SENSOR: 4.5,
    }  # fmt: skip
    assert flexarm("replay", saved, "--output", other, "--size", PIXELS).stdout == f"{other}: written\n"
    assert one.read_bytes() == other.read_bytes()


@pytest.mark.parametrize(
    ("ended", "races", "said"),
    [
        ("finished", True, "finished in 0.50 s"),
        ("truncated", False, "complete"),
        ("truncated", True, "ended by time limit at 0.50 s"),
        ("error", False, "ended by error at 0.50 s"),
    ],
)
def test_render_says_how_an_episode_ended(ended: str, races: bool, said: str) -> None:
    run = FlexibleArm().record(np.linspace(0.0, 0.5, 51), np.zeros((51, 16)), np.zeros((51, 2)))
    assert render.end_of(replace(run, notes={"ended": ended}), races) == said


@pytest.mark.parametrize("verb", ["render", "play"])
def test_what_draws_is_missed_before_anything_runs(verb: str, flexarm: Shell, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pygame", None)
    for name in ("render.episode", "play.LiveArm"):
        monkeypatch.setattr(f"flexarm_agents.commands.{name}", lambda *given: pytest.fail("something ran"))
    assert "[render]" in flexarm(verb, *(["ifdc"] if verb == "render" else []), status=1).stderr


def test_what_is_interrupted_leaves_nothing(run: Trajectory, tmp_path: Path) -> None:
    pytest.importorskip("moviepy")

    def interrupt() -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        Film(run, 10, 1.0, PIXELS).write(tmp_path / "run.mp4", tick=interrupt)
    assert list(tmp_path.iterdir()) == []

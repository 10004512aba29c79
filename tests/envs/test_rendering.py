"""`Renderer`: what a picture shows, and where it can be drawn; pictures, videos and windows of environments."""

import os
import pickle
import sys
from collections.abc import Iterator
from typing import Any
from unittest.mock import patch

import gymnasium
import numpy as np
import pytest
from gymnasium.error import DependencyNotInstalled
from numpy.typing import NDArray

from flexarm_env.envs.rendering import BLUE, FAR, ORANGE, Renderer, Snapshot
from flexarm_env.extras import install_command
from tests.support.envs import GAIN, SQUARE, in_fresh_process
from tests.support.programs import ROOT
from tests.support.refusals import refused, refuses

Picture = NDArray[np.uint8]

SIZE = 300  # [px]; enough to see everything, and fast
NAN, INF = float("nan"), float("inf")
ELBOW, TIP = (-2.5, 3.7), (-6.0, 6.2)
SCENE = Snapshot(
    time=4.2,
    links=(np.linspace((0.0, 0.0), ELBOW, 9), np.linspace(ELBOW, TIP, 9)),
    path=np.array([[-6.3, -6.3], [-6.3, 6.3], [6.3, 6.3], [6.3, -6.3]]),
    trace=np.linspace((-6.0, -6.0), TIP, 100),
    reference=np.array([-5.0, 6.3]),
    sensor=np.array([-6.4, 5.4]),
    sensed=np.array([-7.6, 4.6]),
    torque=np.array([120.0, -40.0]),
    torque_scale=(200.0, 100.0),
    gain=0.6,
    gain_limit=1.0,
    reach=9.0,
)


@pytest.fixture
def renderer() -> Iterator[Renderer]:
    pytest.importorskip("pygame")
    renderer = Renderer("rgb_array", SIZE)
    yield renderer
    renderer.close()


def picture(renderer: Renderer, **changes: Any) -> Picture:
    drawn = renderer.draw(SCENE._replace(**changes))
    assert drawn is not None
    return drawn


def near(drawn: Picture, x: float, y: float) -> Picture:
    """Return the pixel where a point is [m]. Shape (3,)."""
    scale = 0.48 * drawn.shape[0] / SCENE.reach  # a margin of 2 % of the picture surrounds the reach
    return drawn[round(drawn.shape[0] / 2 - scale * y), round(drawn.shape[0] / 2 + scale * x)]


@pytest.mark.parametrize("size", [64, SIZE, 601])
def test_a_picture_is_a_new_square_of_bytes(size: int) -> None:
    pytest.importorskip("pygame")
    renderer = Renderer("rgb_array", size)
    first, second = picture(renderer), picture(renderer)
    assert (first.shape, first.dtype, first.flags.c_contiguous) == ((size, size, 3), np.uint8, True)
    first[:] = 0
    assert second.any()


def test_the_same_snapshot_gives_the_same_pixels(renderer: Renderer) -> None:
    first = picture(renderer)
    picture(renderer, time=9.0, gain=None, sensed=np.zeros(2))  # leaves nothing behind
    np.testing.assert_array_equal(picture(renderer), first)
    np.testing.assert_array_equal(picture(Renderer("rgb_array", SIZE)), first)


@pytest.mark.parametrize(
    "change",
    [
        {"time": 4.3},
        {"links": (SCENE.links[0] + 0.3, SCENE.links[1])},
        {"links": (SCENE.links[0], SCENE.links[1] + 0.3)},
        {"path": 0.9 * SCENE.path},
        {"trace": SCENE.trace * [1.1, 1.0]},
        {"trace": SCENE.trace[:1]},
        {"reference": SCENE.reference + 0.3},
        {"sensor": SCENE.sensor + 0.3},
        {"sensed": SCENE.sensed + 0.3},
        {"torque": np.array([140.0, -40.0])},
        {"torque": np.array([120.0, 40.0])},
        {"torque_scale": (300.0, 100.0)},
        {"torque_scale": (200.0, 300.0)},
        {"gain": 0.8},
        {"gain": None},
        {"gain_limit": 2.0},
        {"reach": 10.0},
    ],
    ids=lambda change: next(iter(change)),
)
def test_everything_shows(renderer: Renderer, change: dict[str, Any]) -> None:
    assert (picture(renderer, **change) != picture(renderer)).any()


def test_markers_are_where_the_points_are(renderer: Renderer) -> None:
    drawn = picture(renderer)
    for point, color in ((TIP, ORANGE), (SCENE.sensor, BLUE), (SCENE.sensed, BLUE)):
        np.testing.assert_allclose(near(drawn, *point), color, atol=30)


def test_sensor_and_reading_differ_in_shape(renderer: Renderer) -> None:
    swapped = picture(renderer, sensor=SCENE.sensed, sensed=SCENE.sensor)
    assert (swapped != picture(renderer)).any()


def test_a_dashed_line_joins_sensor_and_reading(renderer: Renderer) -> None:
    drawn = picture(renderer, sensor=np.array([2.0, -3.0]), sensed=np.array([6.0, -3.0]))
    red = [int(near(drawn, x, -3.0)[0]) for x in np.linspace(2.7, 5.3, 60)]
    assert min(red) < 150
    assert max(red) > 200


def test_the_trace_fades_with_age(renderer: Renderer) -> None:
    trace = np.linspace((-4.0, -5.0), (4.0, -5.0), 400)
    drawn = picture(renderer, trace=trace, time=8.0, path=SCENE.path * 1.2)
    blue = [int(near(drawn, x, -5.0)[2]) for x in (-3.0, -1.0, 1.0, 3.0)]
    assert blue == sorted(blue, reverse=True)
    assert len(set(blue)) == len(blue)


def test_a_full_gauge_saturates_and_its_number_does_not(renderer: Renderer) -> None:
    full, beyond, far = (picture(renderer, torque=np.array([x, 0.0])) for x in (200.0, 300.0, 400.0))
    different = [np.flatnonzero((a != b).any(axis=(0, 2))) for a, b in ((full, beyond), (beyond, far))]
    numbers = 0.27 * SIZE  # right of the bar
    assert different[0].min() < numbers  # the cap
    assert different[1].min() > numbers


@pytest.mark.parametrize("bad", [NAN, INF, -INF, 1e308, -1e308])
@pytest.mark.parametrize("name", ["links", "path", "trace", "reference", "sensor", "sensed", "torque", "gain"])
def test_numbers_may_be_anything(renderer: Renderer, name: str, bad: float) -> None:
    value = getattr(SCENE, name)
    broken = [np.array(array) for array in (value if name == "links" else [value])]
    for array in broken:
        np.atleast_1d(array)[-1] = bad
    picture(renderer, **{name: tuple(broken) if name == "links" else broken[0]})


def test_a_reading_that_is_not_finite_is_left_out(renderer: Renderer) -> None:
    drawn = picture(renderer, sensed=np.array([NAN, 4.6]))
    assert not np.allclose(near(drawn, *SCENE.sensed), BLUE, atol=60)
    np.testing.assert_array_equal(drawn, picture(renderer, sensed=np.full(2, NAN)))
    np.testing.assert_allclose(near(drawn, *SCENE.sensor), BLUE, atol=30)


def test_a_trace_outlives_the_tips_divergence(renderer: Renderer) -> None:
    trace = np.vstack([np.linspace((-4.0, -5.0), (4.0, -5.0), 50), np.full((1, 2), NAN)])
    red, _, blue = near(picture(renderer, trace=trace), 3.0, -5.0).astype(int)
    assert red - blue > 50


def test_points_far_off_do_not_show(renderer: Renderer) -> None:
    far, farther = (picture(renderer, reference=np.full(2, k * FAR * SCENE.reach)) for k in (0.9, 2.0))
    np.testing.assert_array_equal(far, farther)


def test_a_long_trace_is_thinned(pygame: Any, renderer: Renderer) -> None:
    for count in (513, 16_000, 160_000):
        with patch.object(pygame.draw, "polygon", wraps=pygame.draw.polygon) as polygon:
            picture(renderer, trace=np.linspace((-6.0, -6.0), (-6.0, 6.0), count))
        assert 250 < polygon.call_count < 1000


def test_needs_no_display_and_no_environment_variable(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("pygame")
    code = (
        "import sys; sys.path.insert(0, sys.argv[1]); from tests.envs.test_rendering import SCENE, Renderer; "
        "renderer = Renderer('rgb_array', 100); assert 'pygame' not in sys.modules; "
        "assert renderer.draw(SCENE).shape == (100, 100, 3); "
        "import pygame; assert not pygame.display.get_init(); renderer.close()"
    )
    for name in [name for name in os.environ if name.startswith(("SDL_", "PYGAME_", "DISPLAY", "WAYLAND_DISPLAY"))]:
        monkeypatch.delenv(name)
    assert in_fresh_process(code, str(ROOT)) == ""  # a library does not print


def test_a_window_opens_and_closes(pygame: Any) -> None:
    window = Renderer("human", SIZE, fps=1000)
    window.close()
    assert not pygame.display.get_init()
    for _ in range(2):  # it can be opened again
        assert window.draw(SCENE) is None
        shown = pygame.surfarray.array3d(pygame.display.get_surface()).swapaxes(0, 1)
        np.testing.assert_array_equal(shown, picture(Renderer("rgb_array", SIZE)))
        window.close()
        window.close()
        assert not pygame.display.get_init()


def test_a_window_keeps_its_pace(pygame: Any) -> None:
    window = Renderer("human", 64, fps=20)
    window.draw(SCENE)
    begin = pygame.time.get_ticks()
    for _ in range(4):
        window.draw(SCENE)
    assert pygame.time.get_ticks() - begin >= 140  # [ms]
    window.close()


def test_survives_another_environments_quit(pygame: Any, renderer: Renderer) -> None:
    window = Renderer("human", SIZE, fps=1000)
    before = picture(renderer)
    window.draw(SCENE)
    pygame.quit()
    np.testing.assert_array_equal(picture(renderer), before)
    window.draw(SCENE)
    pygame.quit()
    pygame.font.init()
    np.testing.assert_array_equal(picture(renderer), before)
    window.close()


def test_without_pygame_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pygame", None)
    renderer = Renderer("rgb_array")  # needs nothing yet
    with refuses(DependencyNotInstalled, install_command("render")):
        renderer.draw(SCENE)
    renderer.close()


test_bad_arguments_are_refused = refused(
    (("ansi",), "render_mode = 'ansi'.*'rgb_array', 'human'"),
    ((None,), "render_mode = None.*'rgb_array', 'human'"),
    (("human", 63), "size = 63.*from 64 to 2048"),
    (("human", 2049), "size = 2049.*from 64 to 2048"),
    (("human", 600.0), "TypeError: size = 600.0.*an integer"),
    (("human", 600, 0), "fps = 0.*>= 1"),
    by=lambda arguments: Renderer(*arguments),
)


def stepped(env: Any, steps: int, seed: int = 0) -> Any:
    """Draw the picture, or pictures, after some steps with the largest action from the standard start."""
    env.reset(seed=seed, options={"start": "corner"})
    for _ in range(steps):
        env.step(np.ones(env.action_space.shape, np.float32))
    return env.render()


@pytest.mark.parametrize(("env_id", "arm"), [(GAIN, "default"), (SQUARE, "linear")])
def test_a_picture_shows_the_present_instant(env_id: str, arm: str) -> None:
    env = gymnasium.make(env_id, arm=arm, render_mode="rgb_array")
    assert env.metadata["render_fps"] == 100  # real time: a picture for each 10 ms
    first, later, again = stepped(env, 0), stepped(env, 20), stepped(env, 20)
    assert (first != later).any()
    np.testing.assert_array_equal(later, again)


def test_a_copy_of_an_environment_that_has_drawn_goes_on() -> None:
    env = gymnasium.make(GAIN, render_mode="rgb_array")
    stepped(env, 5)
    twin = pickle.loads(pickle.dumps(env))
    for each in (env, twin):
        each.step(np.zeros(1, np.float32))
    np.testing.assert_array_equal(env.render(), twin.render())


def test_a_batch_draws_each_of_its_arms() -> None:
    envs = gymnasium.make_vec(SQUARE, num_envs=3, arm="linear", render_mode="rgb_array")
    with pytest.raises(RuntimeError, match="before reset"):
        envs.render()
    pictures = stepped(envs, 3)
    assert len(pictures) == 3
    alone = gymnasium.make(SQUARE, arm="linear", render_mode="rgb_array")
    np.testing.assert_array_equal(pictures[1], stepped(alone, 3, seed=1))
    envs.close()


def test_a_window_follows_the_steps(pygame: Any) -> None:
    env = gymnasium.make(GAIN, render_mode="human")
    assert stepped(env, 3) is None
    assert pygame.display.get_surface() is not None
    env.close()
    assert pygame.display.get_surface() is None
    env.close()


def test_nothing_is_drawn_without_a_mode() -> None:
    with pytest.warns(UserWarning, match="render mode"):
        assert gymnasium.make(GAIN).unwrapped.render() is None
    with pytest.warns(UserWarning, match="render mode"):
        assert gymnasium.make_vec(GAIN, num_envs=2).render() is None

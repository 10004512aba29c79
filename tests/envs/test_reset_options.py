"""Options of a reset: what they do, and what is refused."""

import math
from typing import Any

import numpy as np
import pytest

from flexarm_env import ArmParameters, FlexibleArm, SquareParameters, square
from tests.support.envs import bare, refused_unmoved
from tests.support.refusals import label, refuses

DRAWING = {"randomisation": {"stiffness": (0.5, 2.0), "delay": (0.0, 0.1), "noise": (0.0, 0.1), "damping": (0.0, 0.3)}}


def test_an_episode_starts_when_it_is_told_to() -> None:
    env, path = bare(start="corner", physics_step=1e-3), square(SquareParameters())
    for time in (0.0, 1.23, 4.0, 15.999):
        info = env.reset(options={"time": time})[1]
        np.testing.assert_allclose(info["reference"], path.position(time), atol=1e-12)
        np.testing.assert_allclose(info["true_tip"], path.position(time), atol=1e-12)
        assert info["time"] == 0.0
        assert env.episode.start_time == pytest.approx(time)


def test_an_episode_starts_how_and_where_it_is_told_to() -> None:
    env = bare(reference=["square", "line"], start="moving")
    info = env.reset(options={"start": "corner", "path": "line"})[1]
    np.testing.assert_allclose(info["true_tip"], (-6.3, -6.3), atol=1e-12)
    assert not info["state"][6:].any()
    np.testing.assert_allclose(env.step(np.zeros(2))[4]["reference"], (-6.3, -6.3 + 12.6 / 8.0 * 0.01), atol=1e-12)
    state = np.linspace(-0.5, 0.6, 12)
    np.testing.assert_allclose(env.reset(options={"state": state})[1]["state"], state, rtol=1e-12)
    rigid = FlexibleArm(ArmParameters.linear()).tip(state[:6])
    np.testing.assert_allclose(env.reset(options={"state": state})[1]["true_tip"], rigid, rtol=1e-12)
    assert abs(env.reset(seed=0)[1]["state"][6:]).max() > 0.1  # options are of one episode


def test_quantities_of_an_episode() -> None:
    env = bare(**DRAWING)
    given = {"stiffness": 0.7, "payload_mass": 3.0, "damping": 0.3, "delay": 0.05, "noise": 0.1, "actuation_delay": 0.0}
    env.reset(options={"parameters": given})
    assert env.episode.parameters == given


@pytest.mark.parametrize(
    ("options", "error", "words"),
    [
        ({"corner": 2}, ValueError, ("options['corner']", "path, direction, elbow_branch, parameters, state")),
        ("corner", TypeError, ("options = 'corner'", "mapping")),
        ("", TypeError, ("options = ''", "mapping")),
        (np.zeros(2), TypeError, ("options = array([0., 0.])", "mapping")),
        ({"start": np.array(0.0)}, ValueError, ("options['start'] = array(0.)", "'corner'")),
        ({"start": b"x"}, ValueError, ("options['start'] = b'x'", "'corner'")),
        ({"time": memoryview(b"a")}, ValueError, ("options['time'] = <memory", "real numbers")),
        ({"start": "side"}, ValueError, ("options['start'] = 'side'", "'corner', 'corners', 'moving', 'mix'")),
        ({"start": 1}, ValueError, ("options['start'] = 1",)),
        ({"elbow_branch": "up"}, ValueError, ("options['elbow_branch'] = 'up'", "'positive', 'negative', 'either'")),
        ({"direction": 1}, ValueError, ("options['direction'] = 1", "'clockwise', 'counterclockwise', 'either'")),
        ({"direction": ["clockwise"] * 2}, ValueError, ("options['direction']", "one value or 1")),
        ({"time": 16.0}, ValueError, ("options['time'] = 16.0", "from 0 to 16")),
        ({"time": -0.1}, ValueError, ("options['time'] = -0.1", "from 0 to 16")),
        ({"time": math.nan}, ValueError, ("options['time'] = nan",)),
        ({"time": "noon"}, ValueError, ("options['time']", "'noon'")),
        ({"time": [0.0, 1.0]}, ValueError, ("options['time']", "(2,)")),
        ({"path": "circle"}, ValueError, ("options['path'] = 'circle'", "'square'")),
        ({"parameters": 3.0}, TypeError, ("options['parameters'] = 3.0", "mapping")),
        (
            {"parameters": {"mass": 3.0}},
            ValueError,
            ("options['parameters']['mass']: no such quantity", "'payload_mass'"),
        ),
        ({"parameters": {"payload_mass": -1.0}}, ValueError, ("options['parameters']['payload_mass'] = -1.0",)),
        ({"parameters": {"payload_mass": math.inf}}, ValueError, ("options['parameters']['payload_mass'] = inf",)),
        ({"parameters": {"delay": 0.11}}, ValueError, ("['delay'] = 0.11", "from 0 to 0.1")),
        ({"parameters": {"noise": 0.11}}, ValueError, ("['noise'] = 0.11", "from 0 to 0.1")),
        ({"parameters": {"stiffness": 2.1}}, ValueError, ("['stiffness'] = 2.1", "to 2")),
        ({"parameters": {"stiffness": 0.0}}, ValueError, ("['stiffness'] = 0.0", "from 0.001")),
        ({"parameters": {"damping": 1.1}}, ValueError, ("['damping'] = 1.1", "from 0 to 0.3")),
        ({"parameters": {"actuation_delay": 0.1}}, ValueError, ("['actuation_delay'] = 0.1", "from 0 to 0")),
        ({"state": np.zeros(11)}, ValueError, ("options['state']", "(12,)", "(11,)")),
        ({"state": np.full(12, 1e4)}, ValueError, ("options['state'][0] = 10000.0", "6283.19")),
        ({"state": [math.nan] * 12}, ValueError, ("options['state'][0] = nan", "finite")),
    ],
    ids=lambda value: label(value) if isinstance(value, dict) else "",
)
def test_a_bad_reset_option_is_refused_and_nothing_moves(
    options: Any, error: type[Exception], words: tuple[str, ...]
) -> None:
    env, twin = bare(**DRAWING), bare(**DRAWING)
    with refused_unmoved(env, twin, error, *words):
        env.reset(seed=7, options=options)


@pytest.mark.usefixtures("uncompiled")
def test_options_that_settings_rule_out() -> None:
    with refuses(ValueError, "options['path'] = 'square'", "has its own path"):
        bare("FlexArm/Reach-v0").reset(options={"path": "square"})
    with refuses(ValueError, "options['direction'] = 'clockwise'", "no effect"):
        bare("FlexArm/Reach-v0").reset(options={"direction": "clockwise"})
    with refuses(ValueError, "['delay'] = 0.01", "from 0 to 0"):
        bare(sensor="collocated").reset(options={"parameters": {"delay": 0.01}})

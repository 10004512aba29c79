"""Options of a reset: what they do, and what is refused."""

import math
from functools import partial
from typing import Any

import numpy as np
import pytest

from flexarm_env import ArmParameters, FlexibleArm, SquareParameters, square
from tests.support.envs import SQUARE, bare, calling, make, vector
from tests.support.refusals import refused

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


@pytest.mark.parametrize("order", [1, -1])
def test_each_environment_of_a_batch_is_asked(order: int) -> None:
    """Whether it can start moving, and has a direction; not the first one alone."""
    fast = [(5.0, 0.0), (5.0, 0.001), (-5.0, 0.001), (-5.0, 0.0)]  # past the shoulder
    slow = [(4.0, 2.0), (4.0, 3.0), (3.0, 3.0)]
    paths: list[Any] = [slow, fast][::order]
    envs = vector(
        "FlexArm/Track-v0", 2, reference="waypoints", start="corner", lap_time=0.05, per_env={"waypoints": paths}
    )
    with pytest.raises(ValueError, match="start = 'moving'"):
        envs.reset(options={"start": "moving"})
    lanes = {"reference": ["square", "waypoints"][::order], "waypoints": [None, slow][::order]}
    with pytest.raises(ValueError, match="direction"):
        vector("FlexArm/Track-v0", 2, per_env=lanes).reset(options={"direction": "clockwise"})


test_a_bad_reset_option_is_refused_and_nothing_moves = refused(
    ({"corner": 2}, r"\['corner'\].*path, direction, elbow_branch, parameters, state"),
    ("", "TypeError: options = ''.*mapping"),
    (np.zeros(2), r"TypeError: options = array\(\[0., 0.\]\).*mapping"),
    ({"start": np.array(0.0)}, r"options\['start'\] = array\(0.\).*'corner'"),
    ({"start": "side"}, r"options\['start'\] = 'side'.*'corner', 'corners', 'moving', 'mix'"),
    ({"elbow_branch": "up"}, r"options\['elbow_branch'\] = 'up'.*'positive', 'negative', 'either'"),
    ({"direction": 1}, r"options\['direction'\] = 1.*'clockwise', 'counterclockwise', 'either'"),
    ({"direction": ["clockwise"] * 2}, r"options\['direction'\].*one value or 1"),
    ({"time": memoryview(b"a")}, r"options\['time'\] = <memory.*real numbers"),
    ({"time": 16.0}, r"options\['time'\] = 16.0.*from 0 to 16"),
    ({"time": -0.1}, r"options\['time'\] = -0.1.*from 0 to 16"),
    ({"time": math.nan}, r"options\['time'\] = nan"),
    ({"time": "noon"}, r"options\['time'\].*'noon'"),
    ({"time": [0.0, 1.0]}, r"options\['time'\].*\(2,\)"),
    ({"path": "circle"}, r"options\['path'\] = 'circle'.*'square'"),
    ({"parameters": 3.0}, r"TypeError: options\['parameters'\] = 3.0.*mapping"),
    ({"parameters": {"mass": 3.0}}, r"options\['parameters'\]\['mass'\]: no such quantity.*'payload_mass'"),
    ({"parameters": {"payload_mass": -1.0}}, r"\['payload_mass'\] = -1.0"),
    ({"parameters": {"payload_mass": math.inf}}, r"\['payload_mass'\] = inf"),
    ({"parameters": {"delay": 0.11}}, r"\['delay'\] = 0.11.*from 0 to 0.1"),
    ({"parameters": {"noise": 0.11}}, r"\['noise'\] = 0.11.*from 0 to 0.1"),
    ({"parameters": {"stiffness": 2.1}}, r"\['stiffness'\] = 2.1.*to 2"),
    ({"parameters": {"stiffness": 0.0}}, r"\['stiffness'\] = 0.0.*from 0.001"),
    ({"parameters": {"damping": 1.1}}, r"\['damping'\] = 1.1.*from 0 to 0.3"),
    ({"parameters": {"actuation_delay": 0.1}}, r"\['actuation_delay'\] = 0.1.*from 0 to 0"),
    ({"state": np.zeros(11)}, r"options\['state'\].*\(16,\).*\(11,\)"),
    ({"state": np.full(16, 1e4)}, r"options\['state'\]\[0\] = 10000.0.*6283.19"),
    ({"state": [math.nan] * 16}, r"options\['state'\]\[0\] = nan.*finite"),
    by=calling(partial(make, arm="default", **DRAWING), "reset", "options", seed=7),
)
test_a_bad_option_of_a_batch_is_refused_and_nothing_moves = refused(
    ({"reset_mask": [True, False]}, r"reset_mask.*shape \(3,\)"),
    ({"reset_mask": np.ones(3)}, "reset_mask.*bool"),
    ({"reset_mask": np.zeros(3, bool)}, "reset_mask.*one True at least"),
    ({"start": ["corner"] * 2}, "one value or 3"),
    ({"start": ["corner", "corner", "side"]}, "start.*'side'.*'corner'"),
    ({"time": [0.0, 16.0, 0.0]}, "time.*16.0.*from 0 to 16"),
    ({"time": np.zeros((3, 1))}, r"time.*\(3, 1\)"),
    ({"parameters": {"payload_mass": [0.0, -1.0, 0.0]}}, "payload_mass.*-1.0"),
    ({"state": np.zeros((2, 12))}, r"state.*\(12,\).*\(2, 12\)"),
    by=calling(vector, "reset", "options", seed=7),
)
test_options_that_settings_rule_out = refused(
    (("FlexArm/Reach-v0", {}, {"path": "square"}), r"options\['path'\] = 'square'.*has its own path"),
    (("FlexArm/Reach-v0", {}, {"direction": "clockwise"}), r"options\['direction'\] = 'clockwise'.*no effect"),
    (("FlexArm/Race-v0", {}, {"start": "mix"}), r"options\['start'\] = 'mix': a race begins at rest; must be 'corner'"),
    ((SQUARE, {"sensor": "collocated"}, {"parameters": {"delay": 0.01}}), r"\['delay'\] = 0.01.*from 0 to 0"),
    by=lambda given: bare(given[0], **given[1]).reset(options=given[2]),
)

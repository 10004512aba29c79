"""Further sensors: their places in the delay line, what they read, and its past at a start."""

from typing import Any

import numpy as np
import pytest

from flexarm_env import SquareParameters, inverse_kinematics, square
from flexarm_env.envs.choices import DEFAULT_OBSERVATION
from flexarm_env.envs.sensors import SECOND
from flexarm_env.envs.settings import Settings
from flexarm_env.episode.step import TORQUE
from flexarm_env.kernels.variants import Variant
from tests.envs.test_observation import motion_of_the_point, recorded
from tests.support.envs import FREE, Array, actions_for, bare, block, played
from tests.support.plain import KERNELS, PlainEnvironment


def plain(key: int = 5, **options: Any) -> PlainEnvironment:
    """Make an environment with the second sensor, at the start of an episode."""
    return PlainEnvironment(key, arm={"modes_per_link": 1}, observation=["second_sensor_error"], **options)


@pytest.mark.parametrize(("link", "place", "delay"), [(1, 3.1, 0.0055), (2, 2.3, 0.0113)])
def test_it_reads_where_its_point_was(link: int, place: float, delay: float) -> None:
    """Between two steps by the cubic through both with their rates."""
    mounted = {"second_sensor_link": link, "second_sensor_position": place, "second_sensor_delay": delay}
    arm, observed = {"modes_per_link": 1}, ["second_sensed_position", "second_sensor_error"]
    options = {"arm": arm, "observation": observed, "start": "corner", "physics_step": 1e-3, **mounted, **FREE}
    env = bare(**options)
    run = recorded(env, seen="second_sensed")
    point = motion_of_the_point(env, options, run, link, place)
    np.testing.assert_allclose(run.sensed, point(run.times - delay), rtol=0.0, atol=1e-9)


@pytest.mark.parametrize("start", ["corners", "moving"])
@pytest.mark.parametrize("key", [5, 6])
def test_at_the_tip_it_reads_what_the_first_one_does(key: int, start: str) -> None:
    """Where both are equally late, to the last bit; the errors differ by the search for the reference only."""
    env = plain(key, start=start, delay=0.0237, second_sensor_delay=0.0237, second_sensor_link=2)
    for _ in range(4):
        assert env.row("FURTHER_READING").tobytes() == env.row("LINK_SENSOR").tobytes()
        assert env.row("F_FURTHER_READING").tobytes() == env.row("F_LINK_SENSOR").tobytes()  # link's frame
        np.testing.assert_allclose(env.row("FURTHER_ERROR"), env.row("SENSOR_ERROR"), rtol=0.0, atol=1e-14)
        env.step([0.3, 0.3])
    assert np.abs(env.row("LINK_SENSOR") - env.row("TRUE_TIP")).max() > 1e-3


@pytest.mark.parametrize(("link", "place"), [(1, 4.5), (1, 2.0), (2, 3.0)])
def test_a_start_on_the_move_has_a_past(link: int, place: float) -> None:
    """The reading is where the reference's motion puts the point, moved by what the arm is off it; so is the error."""
    delay = 0.037
    mounted = {"second_sensor_link": link, "second_sensor_position": place, "second_sensor_delay": delay}
    env = plain(start="moving", elbow_branch="positive", **mounted)
    arm = env.simulator.settings.flexible_arm
    time, path = env.row("START_TIME").item(), square(SquareParameters())

    def on_reference(moment: float) -> Array:
        theta1, theta2 = inverse_kinematics(arm.parameters, path.position(np.array([moment]))[0], "positive")
        point = np.array([np.cos(theta1), np.sin(theta1)]) * (place if link == 1 else 4.5)
        return point + (link == 2) * place * np.array([np.cos(theta1 + theta2), np.sin(theta1 + theta2)])

    present = arm.position(env.row("STATE")[: arm.size], link, place)
    past = on_reference(time - delay)
    # whole steps back, so nothing is interpolated
    np.testing.assert_allclose(env.row("FURTHER_READING"), present + past - on_reference(time), atol=1e-9)
    np.testing.assert_allclose(env.row("FURTHER_ERROR"), on_reference(time) - present, atol=1e-9)


BOTH = ("sensed_position", *DEFAULT_OBSERVATION, *SECOND.blocks)
ON_LINK_1: dict[str, Any] = {"observation": BOTH, "second_sensor_link": 1}


def test_one_sensor_has_no_rows_of_others() -> None:
    assert not [name for name in Variant(TORQUE, 1, True, 1).rows if "FURTHER" in name]


def test_the_delay_line_is_long_enough_for_either_sensor() -> None:
    usual = Settings.of({})
    assert Settings.of(ON_LINK_1).history_slots == usual.history_slots
    longest = Settings.of(ON_LINK_1 | {"second_sensor_delay": 0.5})
    assert longest.history_slots * longest.control_period / longest.substeps >= 0.52


@pytest.mark.parametrize("kernels", KERNELS)
def test_readings_in_an_environment(kernels: str) -> None:
    """The point of link 1 as late as it is, in the link's frame, with noise of its own; nothing else changes."""
    options: dict[str, Any] = {"arm": {"preset": "linear", "modes_per_link": 1}, **FREE}
    options |= {"noise": 0.01, "encoder_noise": (1e-3, 1e-2), "frame": "world", "scaled": False, "start": "moving"}
    quiet = bare(**ON_LINK_1, **options, second_sensor_delay=0.02)
    noisy = bare(**ON_LINK_1, **options, second_sensor_delay=0.02, second_sensor_noise=0.05)
    without = bare(observation=BOTH[:-2], **options)
    actions = 0.2 * actions_for(quiet, 300)
    (rows, told), (noisy_rows, others), (own, fewer) = (
        played(env, actions[:steps], 3) for env, steps in ((quiet, 300), (noisy, 300), (without, 30))
    )
    # what does not concern the second sensor keeps its bits, its noise included
    for found in (rows, noisy_rows):
        np.testing.assert_array_equal(found[:31, : own.shape[1]], own)
    assert "second_sensed" not in fewer
    states, seen = told["state"], told["second_sensed"]
    points = quiet.arm.position(states[:, : quiet.arm.size], 1, 4.5)
    np.testing.assert_allclose(seen[2:], points[:-2], rtol=0.0, atol=1e-12)  # two periods: nothing is interpolated
    np.testing.assert_allclose(block(quiet, rows, "second_sensed_position"), seen, rtol=1e-6, atol=1e-6)
    difference = others["second_sensed"] - seen
    assert difference.std(axis=0) == pytest.approx([0.05, 0.05], rel=0.1)
    assert np.abs(difference.mean(axis=0)).max() < 0.01
    assert abs(np.corrcoef(*difference.T)[0, 1]) < 0.15
    of_first = told["sensed"] - quiet.arm.tip(states[:, : quiet.arm.size])
    assert abs(np.corrcoef(difference[1:, 0], np.diff(of_first[:, 0]))[0, 1]) < 0.15

"""Tasks of one's own: paths for each environment and episode, targets, rewards, ends, and options that last."""

from functools import partial
from typing import Any

import numpy as np
import pytest

from flexarm_env import end_reason, way_points
from tests.support.envs import FREE, bare, drawn_corners, is_bent, same_as_alone, terms_of, terms_together, vector
from tests.support.refusals import refused

TRACK, H = "FlexArm/Track-v0", 0.01
STILL: dict[str, Any] = {"start": "corner", "elbow_branch": "positive", "scaled": False, "frame": "world", **FREE}
CORNERS = [(5.0, 0.0), (5.0, 3.0), (2.0, 5.0), (-2.0, 5.0), (-3.0, 2.0)]
TARGET: dict[str, Any] = {"reference": "target", "waypoints": CORNERS[:1]}


def test_episodes_draw_from_tables_and_functions_by_name() -> None:
    def roof(time: float) -> tuple[float, float]:
        return 4.0, 3.0 + np.sin(time)

    env = bare(TRACK, reference=["square", "tent", roof], waypoints={"tent": CORNERS}, lap_time=8.0)
    assert {(env.reset(seed=seed), env.episode.path)[1] for seed in range(30)} == {"square", "tent", "path_3"}
    for name, target in (("tent", CORNERS[0]), ("path_3", roof(0.0))):
        _, info = env.reset(options={"path": name, "start": "corner"})
        np.testing.assert_array_equal(info["reference"], target)
    alone = bare(TRACK, reference=roof, lap_time=8.0, start="corner")
    told = [alone.step(np.zeros(2))[4]["reference"] for _ in range(9)]
    np.testing.assert_allclose(told[-1], roof(0.09), atol=1e-12)


def test_environments_of_a_batch_have_their_own_paths() -> None:
    """To rounding those of single environments: sides are divided where another environment's path has more."""
    per_env = {"reference": ["square", "circle", "waypoints"], "waypoints": [None, None, CORNERS]}
    envs = vector(TRACK, 3, seed=5, per_env=per_env, start="moving")
    paths = zip(*per_env.values(), strict=True)
    singles = [bare(TRACK, 5 + i, reference=r, waypoints=w, start="moving") for i, (r, w) in enumerate(paths)]
    assert envs.episode.path.tolist() == per_env["reference"]
    for _ in range(40):
        told, expected = envs.step(np.zeros((3, 2)))[4], [single.step(np.zeros(2))[4] for single in singles]
        np.testing.assert_allclose(told["reference"], [info["reference"] for info in expected], atol=1e-12)


def test_a_path_that_cannot_be_drawn_leaves_the_episode_as_it_is() -> None:
    able = [True]

    def drawn(random: np.random.Generator) -> list[tuple[float, float]]:
        if not able[0]:
            raise ValueError("no path today")
        return [*CORNERS]

    env = bare(TRACK, reference="drawn", waypoints=drawn, lap_time=8.0)
    env.step(np.zeros(2))
    able[0] = False
    with pytest.raises(ValueError, match="no path today"):
        env.reset()
    assert env.step(np.zeros(2))[4]["time"] == pytest.approx(2.0 * H)


def test_functions_that_look_alike_are_two() -> None:
    """The representation of a long array leaves its middle out."""

    def shifted(shifts: Any, time: float) -> tuple[float, float]:
        return 4.0 + shifts[1000], time

    tables = [np.zeros(2000), np.eye(1, 2000, 1000)[0]]
    functions = [partial(shifted, table) for table in tables]
    envs = vector(TRACK, 2, seed=0, per_env={"reference": functions}, lap_time=1.0)
    assert [envs.simulator.path(i)[0, 0] for i in (0, 1)] == [4.0, 5.0]


def test_a_seed_determines_drawn_paths_and_rewards() -> None:
    """An environment of a batch is the single one, to the last bit."""
    own = {"reference": "drawn", "waypoints": drawn_corners, "lap_time": 8.0}
    own |= {"reward": terms_together, "termination": is_bent}
    same_as_alone(TRACK, 3, own, 30)
    first, *others = (bare(TRACK, seed, **own, start="corner").step(np.zeros(2))[4]["reference"] for seed in (0, 1, 0))
    np.testing.assert_array_equal(first, others[1])
    assert np.abs(first - others[0]).min() > 1e-3


def test_a_target_that_is_moved_along_a_path_is_that_path() -> None:
    """In each number that is observed: late readings are compared with where it was, previews with where it will be."""
    table = way_points.at_speeds(CORNERS, 3.0, closed=False)
    times = H * np.arange(int(table[-1, 0] / H) + 1)
    at = np.column_stack([np.interp(times, *table.T[[0, axis]]) for axis in (1, 2)])
    options: dict[str, Any] = {"previews": (3 * H, H, 2 * H), **STILL}
    known = bare(TRACK, reference="waypoints", waypoints=np.column_stack([times, at]), **options)
    envs = vector(TRACK, 2, seed=0, **TARGET, **options)
    for n in range(250):
        envs.set_reference(at[n], (at[n + 1] - at[n]) / H, at[[n + 3, n + 1, n + 2]], rows=[1])
        if n == 120:  # copies of the state know the target
            envs.set_state(envs.get_state([1]), [1])
        action = 0.3 * np.sin([n, 2.0 * n])
        expected, (seen, *_, infos) = known.step(action)[0], envs.step(np.tile(action, (2, 1)))
        for name, part in known.observation_blocks.items():
            part = slice(part.start + 2, part.stop) if name == "previews" else part  # the last one is extrapolated
            np.testing.assert_allclose(seen[1][part], expected[part], atol=1e-6, err_msg=name)  # float32
        np.testing.assert_array_equal(infos["reference"][0], CORNERS[0])


def test_the_latest_reading_of_a_batch_is_compared_with_where_its_target_was() -> None:
    options: dict[str, Any] = {**TARGET, "observation": ["sensor_error"], **STILL}
    alone = bare(TRACK, 1, **options, delay=0.2)
    envs = vector(TRACK, 2, seed=0, **options, per_env={"delay": [0.0, 0.2]})
    for n in range(60):
        for each in (alone, envs):
            each.set_reference([5.0, 0.001 * n * n], [0.0, 0.2 * n])
        np.testing.assert_array_equal(envs.step(np.zeros((2, 2)))[0][1], alone.step(np.zeros(2))[0])
        np.testing.assert_array_equal(envs.simulator.path(1), alone.simulator.path(0))


def test_a_target_may_jump_and_stops_where_the_reach_ends() -> None:
    env = bare(TRACK, **TARGET, delay=0.03, observation=["sensor_error"], **STILL)
    env.step(np.zeros(2))
    env.set_reference([0.0, 5.0], [0.0, 10.0])
    for n in range(1, 60):
        error, *_, info = env.step(np.zeros(2))
        late = max((n - 3) * H, 0.0)
        expected = (0.0, min(5.0 + 10.0 * late, 9.0)) if n >= 3 else (5.0, 0.0)
        np.testing.assert_allclose(error + info["sensed"], expected, atol=1e-5)
        np.testing.assert_allclose(info["reference"], (0.0, min(5.0 + 10.0 * n * H, 9.0)), atol=1e-12)
    env.reset()
    np.testing.assert_array_equal(env.step(np.zeros(2))[4]["reference"], (5.0, 0.0))


@pytest.mark.parametrize(
    ("at", "velocity", "end"), [((5.0, 0.0), (-10.0, 0.0), (3.0, 0.0)), ((2.0, 4.0), (0.0, -8.0), (2.0, 5.0**0.5))]
)
def test_a_target_stops_where_the_folded_arm_ends(at: Any, velocity: Any, end: Any) -> None:
    """Links of 6 m and 3 m leave a hole of 3 m."""
    env = bare(TRACK, **TARGET, arm={"link_lengths": (6.0, 3.0)}, observation=["sensor_error"], **STILL)
    env.step(np.zeros(2))
    env.set_reference(at, velocity)
    for _ in range(30):
        reference = env.step(np.zeros(2))[4]["reference"]
        assert np.linalg.norm(reference) > 3.0 - 1e-12
    np.testing.assert_allclose(reference, end, atol=1e-12)


test_bad_tasks_are_refused = refused(
    ({"reference": lambda time: (time,)}, "must be a function from time"),
    ({"reference": lambda time: 1.0 / time}, "waypoints = .*division"),
    ({"reference": "drawn", "waypoints": CORNERS}, "must be a function of a generator"),
    ({"reference": "drawn", "waypoints": lambda rng: [(9.0, 9.0), (1.0, 1.0)]}, "drew no path: .*misses it"),
    ({"reference": "drawn", "waypoints": lambda rng: [(0, 5, 0), (9, 5, 1)]}, "lap of 9.0 s; must be lap_time"),
    ({"reference": "target", "waypoints": CORNERS}, "must be one point"),
    ({"reference": "target", "waypoints": [(9.0, 9.0)]}, "waypoints: must be 0 to 9 m"),
    ({"reference": "a", "waypoints": {"a": CORNERS, "b": CORNERS}}, "must be given with the reference"),
    ({"reference": ["a", "b"], "waypoints": {"a": [(0, 1, 1), (2, 2, 1)], "b": [(0, 1, 1), (3, 2, 1)]}}, "equal"),
    by=lambda options: bare(TRACK, **options),
    kind=(TypeError, ValueError),
)
test_bad_targets_are_refused = refused(
    (([9.0, 9.0],), "position of the reference"),
    (([5.0, 0.0], [50.0, 0.0]), "velocity of the reference: 50 m/s; must be at most 19.88"),
    (([5.0, 0.0], [0.0, 0.0], [[5.0, 9.0]]), "previews of the reference"),
    (([5.0, 0.0], [0.0, 0.0], [5.0, 1.0]), r"previews of the reference: must have shape \(1, 2\)"),
    (([5.0, np.nan],), "position of the reference"),
    by=lambda given: bare(TRACK, **TARGET, observation=["previews"], previews=(H,)).set_reference(*given),
)
test_paths_that_no_batch_has_together_are_refused = refused(
    ([["square", "circle"], "line"], "must each have one"),
    (["square", "moves"], "all environments must have it"),
    by=lambda references: vector(TRACK, 2, per_env={"reference": references}),
)


@pytest.mark.parametrize("mode", ["SameStep", "NextStep", "Disabled"])
def test_rewards_and_ends_are_functions_of_infos(mode: str) -> None:
    """Of the infos of the step that ends an episode; a reset has no reward and ends nothing."""
    own: dict[str, Any] = {"reward": lambda q: -q["tip_error"], "termination": lambda q: q["time"] > 0.045}
    own |= {"start": "corner", **FREE}
    envs, single = vector(TRACK, 3, seed=0, autoreset_mode=mode, **own), bare(TRACK, **own)
    for n in range(1, 6):
        _, rewards, terminated, _, infos = envs.step(np.zeros((3, 2)))
        told = infos["final_info"] if mode == "SameStep" and n == 5 else infos
        np.testing.assert_array_equal(rewards, -told["tip_error"])
        assert terminated.all() == terminated.any() == (n == 5)
        _, reward, ended, _, info = single.step(np.zeros(2))
        assert (reward, ended) == (rewards[0], n == 5)
    assert end_reason(info["end_code"]) == end_reason(told["end_code"][2]) == "own"
    if mode == "NextStep":
        _, rewards, terminated, *_ = envs.step(np.zeros((3, 2)))
        assert np.count_nonzero([rewards, terminated]) == 0


def test_weights_below_zero_count_and_are_told() -> None:
    env = bare(TRACK, reward_weights={"vibration": 1.0, "effort": -0.5, "action_change": 0.0}, start="corner")
    _, reward, *_, info = env.step(np.zeros(2))
    assert terms_of(info) == {"vibration": 1.0, "effort": -0.5}  # a term without weight is not told
    assert reward == 0.5
    with pytest.warns(UserWarning, match="ending an episode early pays"):
        bare(TRACK, reward_weights={"effort": -1.0})
    with pytest.raises(ValueError, match="must be 'target'"):
        bare(TRACK).set_reference([5.0, 0.0])
    with pytest.raises(TypeError, match=r"reward\(infos\) = .*: must be an array .* \(1,\)"):
        bare(TRACK, reward=lambda infos: 1.0).step(np.zeros(2))


@pytest.mark.parametrize("mode", ["SameStep", "NextStep", "Disabled"])
def test_options_last_and_ranges_narrow(mode: str) -> None:
    ranges = {"payload_mass": (0.0, 1.0)}
    envs = vector(TRACK, 4, seed=0, autoreset_mode=mode, randomisation=ranges, start="moving", max_episode_steps=2)
    envs.set_options({"start": "corner"})
    envs.set_options({"randomisation": {"payload_mass": (0.4, 0.5)}})  # the start stays
    for _ in range(12):
        *_, truncated, _ = envs.step(np.zeros((4, 2)))
        if mode == "Disabled" and truncated.any():
            envs.reset(options={"reset_mask": truncated})
    assert not envs.episode.start_time.any()
    assert np.all(np.abs(envs.episode.parameters["payload_mass"] - 0.45) <= 0.05)
    envs.reset(options={"parameters": {"payload_mass": 0.9}})
    assert not envs.episode.start_time.any()
    np.testing.assert_array_equal(envs.episode.parameters["payload_mass"], 0.9)
    envs.set_options({})
    envs.reset(seed=1)
    assert envs.episode.start_time.all()

"""The board: what a cell depends on, that its bits are its own, and what rows add up to."""

from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest

from flexarm_agents import code_version as versions
from flexarm_agents.board import cells as board_cells
from flexarm_agents.board.cells import WITHOUT_PART, Cell, compute, jobs_of
from flexarm_agents.board.columns import COLUMNS, DRAWN, Point, phases
from flexarm_agents.board.entries import SHARED, Entry
from flexarm_agents.board.episodes import observation_map, run_points
from flexarm_agents.board.terms import SEEDS, TASKS, interface_of
from flexarm_agents.code_version import DATA, WITH_POLICIES, code_version
from flexarm_agents.environments import INTERFACE
from flexarm_agents.policies.load import policy_file
from flexarm_baselines.optimal.plan import PLANS
from flexarm_env.envs.options import Options
from flexarm_env.envs.per_env import common_values
from flexarm_env.envs.settings import Settings
from tests.support.boards import SHORT, SMALL, points
from tests.support.refusals import refuses

AGENT = "square"
HERE = "tests.agents.test_board"


class Still:
    """No torque; it counts the episodes that it has begun."""

    files = (__file__,)

    def __init__(self) -> None:
        self.begun = 0

    def predict(self, observation: Any, state: Any, episode_start: Any, deterministic: bool) -> Any:
        assert observation.ndim == 1
        self.begun += int(episode_start[0])
        return np.full(2, 0.01 * self.begun, dtype=np.float32), state


def push(observation: Any) -> Any:
    """Command what is no number after some time."""
    return np.full(2, np.nan if observation[-3] < 0.0 else 0.0, dtype=np.float32)


def refuse(observation: Any) -> Any:
    """Work with nothing."""
    raise ValueError("no observation")


class Quits:
    """No torque; on the swing lap it raises an error half-way."""

    batched = True

    def predict(self, observation: Any, state: Any, episode_start: Any, deterministic: bool) -> Any:
        if np.any((observation[:, 1] < -0.1) & (observation[:, 3] > 0.0)):
            raise ValueError("no solution")
        return np.zeros((len(observation), 2), dtype=np.float32), state


def test_a_first_page_needs_a_point_of_each_column_that_ranks() -> None:
    first, headline, whole = phases(COLUMNS)
    assert {name: len(column.points) for name, column in first.items()} == {"nominal": 1, "unknown": 1}
    assert headline == {name: COLUMNS[name] for name in first}
    assert whole == COLUMNS


def test_the_code_of_a_cell_is_that_of_the_simulation() -> None:
    found = versions._closure(("flexarm_agents.board.episodes",), frozenset(WITHOUT_PART))
    for name in ("physics.dynamics", "episode.step", "episode.reset", "codegen.compiler", "metrics.running"):
        assert f"flexarm_env.{name}" in found
    for name in ("flexarm_baselines.paper_law.ifdc", "flexarm_env.envs.rendering", "flexarm_env.chain.env"):
        assert name not in found
    assert "flexarm_env.chain.model" in versions._closure(("flexarm_env.chain.env",), frozenset(WITHOUT_PART))


def test_what_has_no_part_is_there() -> None:
    for name in (*WITHOUT_PART, *DATA):
        assert versions._is_module(name), name
    assert sorted(PLANS.glob("*.npz")) == versions._data("flexarm_baselines.optimal.plan", DATA)


def test_a_changed_line_is_another_version_but_no_comment(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(tmp_path)
    module, beside = tmp_path / "a_policy_of_mine.py", tmp_path / "its_numbers.py"
    beside.write_text("GAIN = 1.0\n")
    plain = "import numpy\nimport its_numbers\nx = its_numbers.GAIN\n"
    described = '"""Mine."""\nimport numpy\nimport its_numbers  # beside\nx = its_numbers.GAIN\n'

    def version(text: str) -> str:
        module.write_text(text)
        for cached in ("_version", "_closure", "_source", "_is_module"):
            getattr(versions, cached).cache_clear()
        return code_version([module.stem])

    first = version(plain)
    assert first == version(described) != version(plain.replace("x =", "x = 2 *"))
    beside.write_text("GAIN = 3.0\n")
    assert version(plain) != first


def test_a_study_goes_stale_with_the_policies_that_it_loads() -> None:
    loading, others = "flexarm_agents.policies.load", "flexarm_env.physics.paths"
    changed = [code_version([name]) != code_version([name], data=WITH_POLICIES) for name in (loading, others)]
    assert changed == [True, False]


def test_a_key_depends_on_policy_settings_step_and_episodes() -> None:
    row, point = Entry(AGENT), Point(0.0)
    one = Cell.of(row, point)
    assert one.depends["settings"]["physics_step"] == 0.002
    assert one.key == Cell.of(Entry(AGENT, "another name"), Point("also another")).key
    others = [
        Cell.of(Entry("ifdc"), point),
        Cell.of(row, Point(0.0, {"delay": 0.01})),
        Cell.of(row, Point(0.0, {"physics_step": 0.001})),
        Cell.of(row, Point(0.0, seeds=range(2))),
        Cell.of(row, Point(0.0, task="chain")),
        Cell.of(row, Point(0.0, arm={"payload_mass": 0.1})),
    ]
    assert len({cell.key for cell in [one, *others]}) == 7
    # the nominal value of an axis is the nominal cell
    nominal = [point for point in COLUMNS["payload"].points if point.value == COLUMNS["payload"].nominal]
    assert Cell.of(row, nominal[0]).key == one.key


def test_a_key_depends_on_the_bytes_of_a_policy_and_not_on_its_place(tmp_path: Path) -> None:
    moved = tmp_path / "square.npz"
    moved.write_bytes(policy_file(AGENT).read_bytes())
    assert Entry(str(moved)).fingerprint == Entry(AGENT).fingerprint
    assert Entry("ifdc").fingerprint["code"] != Entry("flsac").fingerprint["code"]
    own = Entry(f"{HERE}:Still").fingerprint
    assert own["attribute"] == f"{HERE}:Still"
    assert own["files"] == versions.file_hash(Path(__file__))  # a policy names its own data by `files`


def test_seeds_follow_from_the_policy_and_from_what_is_random(monkeypatch: pytest.MonkeyPatch) -> None:
    """No table from seeds, or first readings, to drawn arms fits the policy that carries it."""

    def seeds(entry: Entry, point: Point) -> list[int]:
        return [one.seed for one in point.seeded(entry.content)]

    unknown = COLUMNS["unknown"].points[0]
    mine, others = (seeds(Entry(name), unknown) for name in (AGENT, "ifdc"))
    assert mine == seeds(Entry(AGENT, "another name"), unknown)
    assert len({*mine, *others}) == len(mine) + len(others)
    assert all(seed in SEEDS for seed in mine)
    few, more, axis = ({"noise": x} for x in (0.0, 0.001, 0.002))
    along = [seeds(Entry(AGENT), Point(0.0, options, seeds=range(2))) for options in (more, axis)]
    assert along[0] == along[1] != seeds(Entry(AGENT), Point(0.0, {"jitter": 0.01}, seeds=range(2)))
    assert seeds(Entry(AGENT), Point(0.0, few)) == seeds(Entry(AGENT), Point(0.0))  # one cell
    monkeypatch.setattr("flexarm_agents.board.terms.BOARD", 4)
    assert not {*mine} & {*seeds(Entry(AGENT), unknown)}


def test_what_runs_every_entry_is_no_entrys_content(monkeypatch: pytest.MonkeyPatch) -> None:
    """So code of the simulator may change, as long as its bits stay, and no entry meets other arms."""
    agent, law = Entry("square"), Entry("joint_pd")
    real, changed = versions._source, set[str]()

    def contents_with(*names: str) -> list[str]:
        changed.update(names)
        versions._version.cache_clear()
        return [agent.content, law.content]

    monkeypatch.setattr(
        versions, "_source", lambda name: real(name)._replace(hash="") if name in changed else real(name)
    )
    before = contents_with()
    assert contents_with("flexarm_env.parameters", "flexarm_agents.policies.network") == before
    own_agent, own_law = contents_with("flexarm_baselines.task")
    assert own_agent == before[0]
    assert own_law != before[1]
    filtered = "flexarm_agents.policies.safety_filter"
    own = versions._closure((filtered,), frozenset(SHARED))
    assert {filtered, "flexarm_baselines.lqg.adaptive"} <= own


def test_a_version_of_code_is_that_of_every_python() -> None:
    """Python 3.12 has a list of type parameters, 3.13 writes no empty list: neither may count."""
    newer, plain = versions.ast.parse("def f(x=None): return x"), versions.ast.parse("def f(x=None): return x")
    newer.body[0].type_params = []  # type: ignore[attr-defined]
    newer.body[0]._fields = (*plain.body[0]._fields, "type_params")  # type: ignore[misc]
    assert versions._written(newer) == versions._written(plain)
    assert versions._written(plain) != versions._written(versions.ast.parse("def f(x=0): return x"))


@pytest.mark.usefixtures("uncompiled")
def test_a_result_has_its_own_bits_whatever_else_is_in_the_batch() -> None:
    row = Entry(AGENT)
    some = points([1.0, 5.0], range(2))
    together = run_points(row, some)
    assert not row.independent  # a network's product may be rounded otherwise in another number of rows
    assert together == [run_points(row, [point])[0] for point in some]
    assert together[0] != together[1]
    assert [(one["lap"], one["seed"]) for one in together[0]["episodes"]] == some[0].seeded(row.content)


def test_a_worker_with_other_code_refuses(monkeypatch: pytest.MonkeyPatch) -> None:
    (job,) = jobs_of([Cell.of(Entry(AGENT), Point(0.0))])
    monkeypatch.setattr(board_cells, "_code", lambda hosted, measure: "another")
    with pytest.raises(ValueError, match="this worker has other code"):
        compute(job)


@pytest.mark.usefixtures("uncompiled")
def test_a_policy_of_one_observation_is_run_episode_by_episode_and_made_anew_for_each_point() -> None:
    first, second = run_points(Entry(f"{HERE}:Still"), points([0.0, 0.0]))
    assert first == second
    assert len(first["episodes"]) == 2


@pytest.mark.usefixtures("uncompiled")
def test_a_lost_path_and_an_action_that_is_no_number_are_results_with_their_time() -> None:
    (lost,) = run_points(Entry(AGENT), [Point(0.0, {**SHORT, "error_limit": 1e-3}, SMALL)])
    (wrong,) = run_points(Entry(f"{HERE}:push", options={"observation": ["lap_phase", "joint_rates"]}), points([0.0]))
    assert [one["ended"] for one in lost["episodes"]] == ["error", "error"]
    assert [one["ended"] for one in wrong["episodes"]] == ["action", "action"]
    for one in [*lost["episodes"], *wrong["episodes"]]:
        assert one["figures"] is None
        assert 0.0 <= one["duration"] < SHORT["lap_time"]
    assert wrong["episodes"][0]["duration"] > 0.0


@pytest.mark.usefixtures("uncompiled")
def test_an_error_of_the_policy_ends_its_own_episode_only() -> None:
    row = Entry(f"{HERE}:Quits", options={"observation": ["lap_phase", "joint_angles"]})
    (found,) = run_points(row, points([0.0]))
    assert [(one["lap"], one["ended"]) for one in found["episodes"]] == [("swing", "policy"), ("plain", "truncated")]
    assert 0.0 < found["episodes"][0]["duration"] < SHORT["lap_time"]
    with pytest.raises(ValueError, match="no observation"):  # from the first instant on: no result
        run_points(Entry(f"{HERE}:refuse"), points([0.0]))


def test_where_a_row_cannot_be_run_it_says_why() -> None:
    late = Entry("ifdc", "late", options={"feedback_source": "sensor", "sensor": "rigid"})
    point = COLUMNS["jitter"].points[-1]
    (result,) = run_points(late, [point])
    assert "must be 0 with feedback_source = 'sensor'" in result["not_applicable"]
    assert "refused" in Cell.of(late, point).depends
    (result,) = run_points(late, [Point("chain", task="chain")])
    assert "on a chain the paper's law acts on the joints' own angles" in result["not_applicable"]


def test_a_row_chooses_what_it_observes_and_no_more() -> None:
    with refuses(ValueError, "options['delay'] = 0.0", "is the board's to choose"):
        Entry(AGENT, options={"delay": 0.0})
    assert interface_of({"delay": 0.0, "scaled": False}) == {"scaled": False}
    assert set(INTERFACE) <= set(Options.__dataclass_fields__)
    with refuses(ValueError, "name = 'a|b'"):
        Entry(AGENT, "a|b")


def test_a_folder_or_a_source_of_any_name_is_an_entry(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    own = tmp_path / "v1.5@home"
    own.mkdir()
    monkeypatch.chdir(own)
    assert [Entry(source).name for source in (".", str(own))] == ["v1.5_home"] * 2
    assert Entry(f"{'package.' * 10}module:Mine").name.endswith(".package.module:Mine")


def test_an_axis_has_its_nominal_value_and_ends_that_an_environment_takes() -> None:
    for name, column in COLUMNS.items():
        if isinstance(column.nominal, float):
            values = [float(point.value) for point in column.points]
            assert min(values) <= column.nominal <= max(values), name
            assert values == sorted(values)
        elif column.nominal is not None:
            assert column.nominal in [point.value for point in column.points], name
        for point in column.points[:: max(1, len(column.points) - 1)]:
            of_race = {"action_mode": "race"} if point.task == "race" else {}
            Settings.of(point.environment_options(of_race))
    assert sum(len(point.episodes) for point in COLUMNS["unknown"].points) == DRAWN
    laps = [one.lap for point in COLUMNS["unknown"].points for one in point.episodes]
    assert laps.count("swing") == laps.count("plain") == DRAWN // 2
    assert {point.task for column in COLUMNS.values() for point in column.points} == set(TASKS)


def test_no_block_tells_a_late_sensors_delay() -> None:
    for point in COLUMNS["delay"].points:
        settings = Settings.of(point.environment_options({}))
        assert settings.sensor_delays == Settings.of({}).sensor_delays
        assert settings.range_of("delay") == (1e-3 * float(point.value),) * 2


@pytest.mark.slow  # kernels of the laboratory arm, which no other test compiles
def test_a_faster_lap_and_the_laboratory_arm_have_plans_of_their_own() -> None:
    entry = Entry("plan_lqr")
    assert entry.candidate("pace5").policy.plans[0].torques.shape == (500, 2)
    column = COLUMNS["lab"]
    result = run_points(entry, column.points)
    found = {point.value: one["episodes"][0]["figures"] for point, one in zip(column.points, result, strict=True)}
    # planned for this arm, with a regulator of its state; the rig's dry friction is not in the plan
    assert found["data sheet"]["rms"] < 1e-4 < found["measured"]["rms"] < 1e-2


def test_settings_fit_into_one_batch_where_their_common_values_are_equal() -> None:
    nominal = common_values(Settings.of({}))
    alike = [{"delay": 0.1}, {"arm": {"payload_mass": 1.0}}, {"noise": 0.01}]
    unlike = [{"arm": {"modes_per_link": 2}}, {"physics_step": 1e-3}, {"frame": "world"}, {"arm": "linear"}]
    assert all(common_values(Settings.of(one)) == nominal for one in alike)
    assert all(common_values(Settings.of(one)) != nominal for one in unlike)


def test_strain_gauges_keep_their_calibration_on_an_arm_with_other_shapes() -> None:
    def env(**arm: Any) -> Any:
        return gymnasium.make("flexarm_env:FlexArm/Square-v0", arm=arm).unwrapped

    nominal, richer = env(), env(modes_per_link=4)
    assert observation_map(env(payload_mass=0.5), nominal) is None
    matrix = observation_map(richer, nominal)
    assert matrix is not None
    # a deflection that the nominal shapes can express is read as their coordinates
    q = np.array([0.3, -0.2, 0.1])
    places = np.linspace(0.0, 4.5, 40)
    wanted = nominal.arm.modes[0].shape(places) @ q
    own = np.linalg.lstsq(richer.arm.modes[0].shape(places), wanted, rcond=None)[0]
    observation = np.zeros(len(richer.observation_scale))
    blocks, scale = richer.observation_blocks, richer.observation_scale
    observation[blocks["modal_coordinates"]][:4] = own / scale[blocks["modal_coordinates"]][:4]
    observation[blocks["previews"]] = 0.5
    seen = matrix @ observation
    block = nominal.observation_blocks["modal_coordinates"]
    np.testing.assert_allclose(seen[block][:3] * nominal.observation_scale[block][:3], q, atol=1e-9)
    np.testing.assert_array_equal(seen[nominal.observation_blocks["previews"]], 0.5)

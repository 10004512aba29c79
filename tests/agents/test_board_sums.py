"""The board: what episodes add up to."""

from dataclasses import replace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import binom

from flexarm_agents.board.columns import COLUMNS, Column, Point
from flexarm_agents.board.summary import kept, lap_summary, loss, loss_interval, point_summary, quantile, whole_summary
from flexarm_agents.board.terms import TASKS
from flexarm_agents.commands import sweep
from tests.support.boards import points
from tests.support.shell import Shell


def episode(rms: float | None, duration: float = 16.0, lap: str = "plain") -> dict[str, Any]:
    figures = None if rms is None else {"rms": rms, "rms_after_2s": rms, "maximum": rms}
    return {"lap": lap, "seed": 0, "ended": "truncated", "duration": duration, "figures": figures}


def test_lost_episodes_are_counted_and_never_averaged() -> None:
    found = lap_summary([episode(0.1), episode(0.3), episode(None, 2.5), episode(None, 1.5)])
    assert (found["episodes"], found["lost"], found["first_loss"]) == (4, 2, 1.5)
    assert found["rms"] == {"mean": pytest.approx(0.2), "least": 0.1, "most": 0.3, "median": 0.3, "p90": None}
    other = lap_summary([episode(None, 1.0)])
    assert other["rms"] is None
    assert loss([found, other]) == pytest.approx(0.6)
    assert point_summary(None) is None
    assert point_summary({"not_applicable": "why"}) == {"not_applicable": "why"}


def test_an_axis_is_kept_as_far_as_no_lap_is_lost_on_either_side() -> None:
    column = Column("factor", "1", tuple(Point(x) for x in (0.8, 0.9, 1.0, 1.1, 1.2)), 1.0)

    def along(*errors: float | None) -> list[float]:
        return kept(column, [point_summary({"episodes": [episode(x), episode(0.1, lap="swing")]}) for x in errors])

    assert along(0.1, 0.1, 0.1, 0.9, 0.1) == [0.8, 0.9, 1.0, 1.1, 1.2]
    assert along(0.1, None, 0.1, 0.2, None) == [1.0, 1.1]
    assert along(0.1, 0.1, None, 0.1, 0.1) == []
    assert kept(column, [{"not_applicable": "why"}] * 5) == []
    column = replace(column, bound=0.15)
    assert along(0.1, 0.1, 0.1, 0.9, 0.1) == [0.8, 0.9, 1.0]
    assert along(0.2, None, 0.15, 0.1, 0.1) == [1.0, 1.1, 1.2]


def test_quantiles_take_lost_episodes_as_infinite_and_invent_no_value() -> None:
    values: list[float | None] = [0.3, 0.1, None, 0.2, None, 0.5, 0.4, 0.6, 0.7, 0.8]
    assert quantile(values, 0.5) == 0.5  # the fifth of ten: half of them lie at or below it
    assert quantile(values, 0.8) == 0.8
    assert quantile(values, 0.9) is None
    assert quantile([None], 0.5) is None
    column = Column("sample", "", (Point("a"), Point("b")), sample=True)
    found = whole_summary(column, [{"episodes": [episode(x) for x in half]} for half in (values[:5], values[5:])])
    assert found is not None
    assert (found["lost"], found["rms"]["median"], found["rms"]["p90"]) == (2, 0.5, None)
    assert whole_summary(column, [{"episodes": [episode(0.1)]}, None]) is None


@given(episodes=st.integers(1, 300), share=st.floats(0.0, 1.0))
def test_the_interval_of_a_loss_rate_is_that_of_clopper_and_pearson(episodes: int, share: float) -> None:
    """At each end, the losses that were seen or more (less) have a probability of 2.5 %."""
    lost = round(share * episodes)
    low, high = loss_interval(lost, episodes)
    assert low <= lost / episodes <= high
    assert low == 0.0 if lost == 0 else binom.sf(lost - 1, episodes, low) == pytest.approx(0.025, rel=1e-6)
    assert high == 1.0 if lost == episodes else binom.cdf(lost, episodes, high) == pytest.approx(0.025, rel=1e-6)


@pytest.mark.usefixtures("uncompiled")
def test_evaluate_sweeps_an_axis(flexarm: Shell, monkeypatch: pytest.MonkeyPatch) -> None:
    tiny = {"noise": Column("Sensor noise", "mm", tuple(points([0.0, 1.0])), 0.0)}
    monkeypatch.setattr(sweep, "COLUMNS", tiny)
    told = flexarm("evaluate", "--policy", "square", "--sweep", "noise", "--output", "scores.json").stdout
    (results,) = [one["results"] for one in flexarm.evaluation()["rows"]]
    for point in results:
        for one in point["episodes"]:
            assert f"{one['figures']['rms']:.3f}" in told
    assert "no lap lost: 0 to 1" in told


def test_each_task_has_its_own_figure_and_laps() -> None:
    column = COLUMNS["race"]
    races = [{"lap": None, "duration": t, "figures": dict.fromkeys(TASKS["race"].figures, t)} for t in (21.0, 23.0)]
    points = [
        point_summary({"episodes": races}, "race"),
        point_summary({"episodes": [races[0] | {"figures": None}]}, "race"),
    ]
    first, second = [line.split() for line in sweep._table("mine", column, points).splitlines()[-2:]]
    assert first == ["nominal", "0", "of", "2", "21.000", "23.000", "22.000"]
    assert second == ["unknown", "arms", "1", "of", "1", "lost", "lost", "-", "at", "21.00", "s"]


def test_points_with_another_figure_or_other_laps_have_a_table_of_their_own() -> None:
    carry, race = (COLUMNS[name] for name in ("carry", "race"))
    first, second = sweep._table("mine", carry, [None] * 3).split("\n\n")
    assert first.startswith("Distance of the tip from its mean place, r.m.s. over the rests, swing lap / plain lap: ")
    assert [line.split("  ")[0].strip() for line in first.splitlines()[-2:]] == ["nominal mass", "0.2 to 1.5 kg"]
    assert second.startswith("Distance of the tip from the reference, r.m.s. over the lap, swing lap / plain lap: ")
    assert second.splitlines()[-1].startswith("on the lap ")
    assert [head in second for head in ("mine: carry", "after 2 s [m]")] == [True, True]
    assert "\n\n" not in sweep._table("mine", race, [None] * 2)


def test_lost_laps_come_first_and_count() -> None:
    column = Column("Sensor noise", "mm", tuple(points([0.0, 1.0])), 0.0)
    complete = {"lap": "plain", "duration": 16.0, "figures": {"rms": 0.5, "rms_after_2s": 0.4, "maximum": 1.0}}
    lost = {"lap": "plain", "duration": 3.0, "figures": None}
    swing = [one | {"lap": "swing"} for one in (complete, complete)]
    episodes = [{"episodes": [*swing, complete, one]} for one in (complete, lost)]
    found = sweep._table("mine", column, [point_summary(one) for one in episodes]).splitlines()
    (line,) = [one for one in found if one.startswith("1 ")]
    assert line.split() == [
        *("1", "0", "of", "2", "/", "1", "of", "2"),
        *("0.500", "/", "0.500", "0.500", "/", "lost", "0.500", "/", "0.500", "0.400", "/", "0.400", "at", "3.00", "s"),
    ]
    assert found[-1] == "no lap lost: 0"

"""What of the source counts: for seeds of the board, and for what is stale."""

import pytest

from flexarm_agents import code_version as versions
from flexarm_agents.board.entries import SHARED, Entry


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

"""Races at a pace: the plan waits for an arm that lags, and the reference is where the controller takes it to be."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import gymnasium
import numpy as np
import pytest

from flexarm_baselines.lqg.race import race_plan
from flexarm_baselines.lqg.race_paced import CLOSER, LEAST, MOST, Paced, PacedLQG
from flexarm_baselines.optimal import Plan
from flexarm_baselines.predictive import Instant, contouring
from flexarm_baselines.predictive.contouring import Prediction
from flexarm_baselines.predictive.iteration import RealTimeIteration
from flexarm_baselines.race_mpcc import PRICE, RaceMPCC
from flexarm_baselines.registry import controller
from tests.support.late_arm import plan, task
from tests.support.refusals import refused

PERIODS = 80


def beginning(periods: int = PERIODS) -> Plan:
    """Return the first periods of the steady plan."""
    plan = race_plan("steady")
    notes = {"ways": plan.notes["ways"][: periods + 1]}
    arrays = plan.states[: periods + 1], plan.torques[:periods], plan.reference[: periods + 1]
    return Plan(plan.parameters, *arrays, plan.limits, plan.period, plan.step, notes)


def race(kind: type[Paced], **parameters: float) -> tuple[Any, Any, list[dict[str, Any]]]:
    """Run a controller along the beginning of the plan; return it, its last memory, and all infos."""
    drawn = {"randomisation": {name: (value, value) for name, value in parameters.items()}}
    env = gymnasium.make("FlexArm/Race-v0", **kind.options() | drawn)
    driver = kind.for_env(env, beginning(2 * PERIODS))  # a prediction sees 50 periods more
    memory, infos = None, []
    observation, _ = env.reset(seed=0)
    for _ in range(PERIODS - 10):
        action, memory = driver.predict(observation, memory)
        observation, _, terminated, _, info = env.step(action)
        assert not terminated
        infos.append(info)
    env.close()
    return driver, memory, infos


@pytest.mark.parametrize("payload", [0.0, 1.0])
def test_the_plan_waits_for_a_heavy_arm_and_the_reference_is_where_it_is_taken_to_be(payload: float) -> None:
    """On the model's arm all goes by the plan; the same torques move a heavy one less far."""
    driver, memory, infos = race(PacedLQG, payload_mass=payload)
    *_, instants, way, speed = memory
    np.testing.assert_allclose(infos[-1]["progress"], way[0], atol=1e-9)
    np.testing.assert_allclose(infos[-1]["reference_speed"], speed[0], atol=1e-6)
    late = len(infos) - instants[0]
    assert abs(late) < 0.5 if payload == 0.0 else 1.0 < late < (1.0 - LEAST) * len(infos)
    np.testing.assert_allclose(way, np.interp(instants, np.arange(2 * PERIODS + 1), driver.ways), atol=0.02)


def test_the_pace_makes_up_for_the_lag_of_the_tip() -> None:
    """A lag of two periods costs twice the share of one; far off, the pace stays within its limits."""
    env = gymnasium.make("FlexArm/Race-v0", **PacedLQG.options())
    driver = PacedLQG.for_env(env, beginning())
    now = 50
    for lag, pace in ((0, 1.0), (1, 1.0 - CLOSER), (2, 1.0 - 2.0 * CLOSER), (9, LEAST), (-9, MOST)):
        after = (driver.filter.nominal[:, now + 1 - lag],)
        found = driver.pace(np.full(1, float(now)), after)
        np.testing.assert_allclose(found, pace, atol=1e-12)


def test_contouring_gains_on_the_plan_within_limits() -> None:
    """With a price, a prediction ends further along the plan."""
    _, (way, _, torque, _, _, instants, *_), infos = race(RaceMPCC)
    assert instants[0, 0] > 1.02 * len(infos)
    np.testing.assert_allclose(infos[-1]["progress"], way[0], atol=1e-6)
    assert (np.abs(torque) <= np.array([150.0, 50.0])).all()
    envs = gymnasium.make_vec("flexarm_env:FlexArm/Race-v0", num_envs=3, **RaceMPCC.options())
    driver, free = (RaceMPCC.for_env(envs, beginning(2 * PERIODS), price=price) for price in (PRICE, 0.0))
    observations, _ = envs.reset(seed=0)
    together = None
    for _ in range(5):
        actions, together = driver.predict(observations, together)
        observations, *_ = envs.step(actions)
    now = Instant(np.zeros(3, dtype=np.int64), np.zeros(3, dtype=np.int64), together[3][:, 0], together[2], {})
    plain, priced = (one.iteration.contoured(Prediction(*together[3:6]), now).instants for one in (free, driver))
    assert (priced[:, -1] > plain[:, -1] + 0.1).all()
    paces = np.diff(priced)
    assert (paces >= contouring.LEAST).all()
    assert (paces <= contouring.MOST).all()


def test_at_the_plans_pace_contouring_is_the_iteration_of_nmpc(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without a choice of pace, an iteration minimises the same cost: that of a horizon, and of what follows it."""
    monkeypatch.setattr(contouring, "LEAST", 1.0)
    monkeypatch.setattr(contouring, "MOST", 1.0)
    env = gymnasium.make("FlexArm/Race-v0", **RaceMPCC.options())
    own = RaceMPCC.for_env(env, beginning(2 * PERIODS), price=0.0).iteration
    arguments = own.horizon, tuple(own.limits), own.period, own.step, own.damping
    plain = RealTimeIteration(own.model, replace(own.runs, slopes=np.zeros_like(own.runs.slopes)), *arguments)
    period, random = np.array([0, 7, 40]), np.random.default_rng(5)
    states, torques = plain.predicted(np.zeros(3, dtype=np.int64), period)
    run = own.model.rollout(states[:, 0], torques + random.normal(0.0, 4.0, torques.shape), period=own.period)
    now = Instant(np.zeros(3, dtype=np.int64), period, states[:, 0], random.normal(0.0, 1.0, (3, 2)), {})
    instants = period[:, None] + np.arange(own.horizon + 1.0)
    found, same = own.contoured(Prediction(run.states, run.torques, instants), now), plain.improve(run, now)
    np.testing.assert_allclose(found.torques, same.torques, rtol=0.0, atol=1e-6)
    assert np.abs(same.torques - run.torques).max() > 0.1


def test_entries_have_the_steady_plan_and_another_one_is_refused() -> None:
    for name in ("race_lqg_adaptive", "race_mpcc"):
        assert controller(name).design == {"plan": "steady"}
        assert issubclass(controller(name).kind, Paced)
    env = gymnasium.make("FlexArm/Race-v0", **PacedLQG.options())
    shifted = beginning()
    with pytest.raises(ValueError, match="must be a race of the plan's arm"):
        PacedLQG.for_env(env, replace(shifted, reference=shifted.reference + 0.1))
    with pytest.raises(ValueError, match="must be one of 'default', 'steady'"):
        PacedLQG.for_env(env, "fast")


test_refusals = refused(
    ({"iterations": 2}, "iterations = 2: must be 1"),
    ({"damping": 0.1}, r"damping = 0\.1: must be 0\.0"),
    by=lambda design: RaceMPCC(task(), [plan()], **design),
)

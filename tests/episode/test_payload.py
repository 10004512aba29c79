"""Payloads that change within the lap, in plain Python: against arms that are made with the mass, and energies."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from flexarm_env.codegen.declarations import plain_python
from flexarm_env.envs.hosted import HostedSimulator
from flexarm_env.envs.settings import Settings
from flexarm_env.episode.payload import carried_payload
from flexarm_env.kernels.entries import clock_row, column
from flexarm_env.kernels.variants import block_at
from flexarm_env.simulation.arm import FlexibleArm
from tests.support.plain import PlainEnvironment
from tests.support.refusals import refused, refuses

LINEAR = {"preset": "linear", "modes_per_link": 1}
ARMS = [{"modes_per_link": 1, "payload_mass": 0.4}, LINEAR | {"payload_mass": 0.4}]
CARRIED = ((0.03 / 16, 1.3), (0.05 / 16, None))
FAST: dict[str, Any] = {"start": "corner", "elbow_branch": "negative", "payload_changes": CARRIED}
ACTIONS = [(0.9, -0.4), (0.7, 0.8), (-0.3, 0.5), (0.4, -0.9), (0.2, 0.6), (-0.8, 0.1), (0.5, 0.5)]


def arm_with(arm: dict[str, Any], mass: float) -> FlexibleArm:
    return FlexibleArm(replace(Settings.of({"arm": arm}).flexible_arm.parameters, payload_mass=mass))


@pytest.mark.parametrize("arm", ARMS)
def test_motion_goes_on_as_that_of_an_arm_made_with_the_mass(arm: dict[str, Any]) -> None:
    """Its state is where the last one left off: no rate jumps. The payload of the lap's start is the last change's."""
    env = PlainEnvironment(arm=arm, **FAST)
    begun = env.row("CONSTANTS")
    states, carried = env.follow(ACTIONS, "STATE", "CARRIED")
    # the change at 0.03 s is in the period that begins then
    assert carried[:, 0].tolist() == [0.4] * 4 + [1.3] * 2 + [0.4] * 2
    torques, step = np.float32(ACTIONS).astype(float) * (150.0, 50.0), env.simulator.settings.integration.step
    for n, mass in enumerate(carried[1:, 0]):
        expected = arm_with(arm, mass).rollout(states[n], torques[n : n + 1], step=step).states[1]
        scale = np.abs(states[n]).max()
        np.testing.assert_allclose(states[n + 1], expected, rtol=0.0, atol=1e-11 * scale)  # constants round otherwise
    np.testing.assert_array_equal(env.row("CONSTANTS"), begun)  # put down: the same numbers to the bit


def test_a_change_is_due_at_its_integration_step() -> None:
    """Also of an episode that begins between two control periods of the lap."""
    env = PlainEnvironment(
        arm=ARMS[0], **FAST | {"payload_changes": ((0.036 / 16, 2.0), (0.2 / 16, 0.0)), "start": "mix"}
    )
    env.simulator.usual_requests = env.simulator.usual_requests.copy()
    env.simulator.usual_requests[:, column.PHASE] = 0.026
    env.simulator._usual = False
    env.reset()
    (carried,) = env.follow([(0.5, 0.0)] * 2, "CARRIED")
    assert carried.tolist() == [[0.0], [0.0], [2.0]]


@settings(max_examples=20)
@given(
    st.lists(st.floats(0.0, 0.99), min_size=2, max_size=4, unique=True), st.floats(5.0, 20.0), st.integers(0, 40_000)
)
def test_the_latest_change_of_the_lap_counts(phases: list[float], lap: float, steps: int) -> None:
    phases = sorted(phases)
    changes = tuple((one, float(n)) for n, one in enumerate(phases))
    env = PlainEnvironment(arm=ARMS[0], lap_time=lap, payload_changes=changes, start="corner", physics_step=0.002)
    with plain_python(env.simulator._variant):
        block = block_at(env.simulator._memory, 0)
        block.clock[clock_row.STEPS, 0] = steps
        found = carried_payload(block, 0, 0)
    phase = steps * env.simulator.settings.integration.step / lap % 1.0
    if min(abs(phase - one) for one in (*phases, 1.0)) > 1e-6:
        assert found == (np.searchsorted(phases, phase) - 1) % len(phases)


def test_success_is_to_be_there_when_the_payload_changes() -> None:
    """The reference of "stops" rests at first; that of the square leaves the arm behind."""
    for reference, first, second, expected in (("stops", 0.01, 0.02, [0, 0, 1]), ("square", 0.05, 0.06, [0] * 9)):
        changes = ((first / 16, 1.0), (second / 16, 0.0))
        env = PlainEnvironment(arm=ARMS[0], reference=reference, payload_changes=changes, start="corner")
        (found,) = env.follow([(0.0, 0.0)] * (len(expected) - 1), "SUCCESS")
        assert found[:, 0].tolist() == expected
        assert env.row("MISSED") == [reference == "square"]


test_what_does_not_fit_is_refused = refused(
    (((0.1, 0.5),), "payload_changes.*two changes at least"),
    (((0.2, 0.5), (0.1, 0.0)), "payload_changes.*shares that increase"),
    (((0.0, 0.5), (1.0, 0.0)), "payload_changes.*must not be at shares 0 and 1"),
    (((0.1, 0.5), (0.2,)), "payload_changes.*a share of the lap and a mass"),
    (((0.1, 0.5), (1.2, 0.0)), "payload_changes.*must be"),
    (((0.1, -0.5), (0.2, 0.0)), "payload_changes.*must be"),
    by=lambda changes: Settings.of({"payload_changes": changes}),
)


def test_other_arms_and_modes_change_no_payload() -> None:
    with refuses(ValueError, "payload_changes", "no effect with action_mode = 'gain'"):
        Settings.of({"payload_changes": CARRIED, "action_mode": "gain"})
    with refuses(ValueError, "payload_changes", "compiled arm"):
        HostedSimulator(Settings.of({"payload_changes": CARRIED}), None)  # type: ignore[arg-type]


def test_the_step_is_that_of_the_lightest_arm() -> None:
    """A payload that is put down leaves faster modes, though the arm has one."""
    light = Settings.of({"physics_step": None})
    heavy = Settings.of({"arm": {"payload_mass": 5.0}})
    both = Settings.of({"arm": {"payload_mass": 5.0}, "payload_changes": ((0.1, 0.0), (0.2, None))})
    assert both.range_of("payload_mass") == (0.0, 5.0)
    assert both.substeps >= max(light.substeps, heavy.substeps)

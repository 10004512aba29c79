"""Jacobians of a control period beside plain steps and JAX's forward mode; iterations that plan a lap with them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from flexarm_baselines.optimal import lap_problem, load_plan
from flexarm_baselines.optimal.solver import Search
from flexarm_env import ArmParameters, FlexibleArm, formulas
from flexarm_env.simulation.feedback import Rollout
from scripts.benchmarks import peers
from scripts.benchmarks.timing import Group, Ratio, Subject

ARMS = 1024
PERIOD = 0.01  # [s]
LINEAR = {"2 modes": ArmParameters.linear()}
BENT = ArmParameters.linear(modes_per_link=3, kinematics="foreshortened", mode_shapes="polynomial")


def jacobians(effort: float, everything: bool) -> Group:
    """All Jacobians of a control period, a column of them as a unit of work.

    Args:
        effort: factor on the work of a timed call.
        everything: the foreshortened arm too, and JAX on the linear one, which takes it minutes to compile.
    """
    subjects, ratios = [], []
    for name, parameters in (LINEAR | ({"3 polynomials, foreshortened": BENT} if everything else {})).items():
        arm = FlexibleArm(parameters)
        steps = int(np.ceil(PERIOD / min(1e-3, arm.longest_step())))
        state = np.zeros((ARMS, 2 * arm.size))
        state[:, 1] = np.linspace(0.5, 2.5, ARMS)
        plain, each = f"{name}, plain steps", f"{name}, a column"
        calls, step = max(1, round(10 * effort)), PERIOD / steps
        subjects += [
            Subject(plain, _repeated(10 * calls, arm.step, state, step), 10 * calls * ARMS * steps),
            Subject(each, _repeated(calls, arm.step_jacobians, state, step), calls * ARMS * steps * (2 * arm.size + 5)),
        ]
        ratios.append(Ratio(each, plain, f"a column over a plain step, {name} (a fair limit is 0.6)"))
        if everything and name in LINEAR and peers.installed("jax"):
            forward = _jax(arm, state, step, steps)
            subjects.append(Subject(f"{each} by JAX", forward, ARMS * steps * (2 * arm.size + 2)))
            ratios.append(Ratio(f"{each} by JAX", each, f"JAX's vmap(jacfwd) over ours, {name}"))
    return Group("jacobians", "Jacobians of a control period, batch of 1024", "ns", "step and arm", subjects, ratios)


def iterations(everything: bool) -> Group:
    """Time iterations of trajectory optimisation over a lap, about the plan of the package."""
    subjects: list[Subject] = []
    ratios: list[Ratio] = []
    for name in ("linear", "default")[: 1 + everything]:
        plan = load_plan(f"{name}_plain")
        search = Search(lap_problem(plan.arm, "plain"), Rollout(plan.states, plan.torques))
        first, second = (
            Subject(f"{name} arm, of {order} order", _iteration(search, order == "second"))
            for order in ("first", "second")
        )
        subjects += [first, second]
        ratios.append(Ratio(second.name, first.name, f"an iteration of second order over one of first, {name} arm"))
    return Group("iterations", "Trajectory optimisation, 1600 control periods", "ms", "iteration", subjects, ratios)


def _iteration(search: Search, exact: bool) -> Callable[[], None]:
    def work() -> None:
        search.exact = exact
        search.forward_pass()
        search.differentiate()

    return work


def _repeated(calls: int, function: Callable[..., Any], state: Any, step: float) -> Callable[[], None]:
    def work() -> None:
        for _ in range(calls):
            function(state, (20.0, -5.0), PERIOD, step=step)

    return work


def _jax(arm: FlexibleArm, state: Any, h: float, steps: int) -> Callable[[], None]:
    """Make a function that computes the Jacobians by states and torques in JAX, on the processor."""
    import jax

    size = state.shape[1]

    def period(numbers: Any) -> Any:
        def one(_: int, x: Any) -> Any:
            return jax.numpy.stack(formulas.step(arm, x, numbers[size:], h, jax.numpy.sin, jax.numpy.cos))

        return jax.lax.fori_loop(0, steps, one, numbers[:size])

    with jax.enable_x64(True):
        numbers = jax.numpy.array(np.concatenate([state, np.tile((20.0, -5.0), (len(state), 1))], axis=1))
        compiled = jax.jit(jax.vmap(jax.jacfwd(period))).lower(numbers).compile()

    def work() -> None:
        compiled(numbers).block_until_ready()

    return work

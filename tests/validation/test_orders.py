"""Order of convergence of every integrator, against scipy's DOP853 at tight tolerance.

The equations of motion are the package's (`FlexibleArm.acceleration`); what drives them is written here anew: held
torques, a torque that is a function, the environments' joint-space law, and the paper's law without and with delay
(method of steps: the past is read from the solution already found, never from within the step at hand).
"""

from collections.abc import Callable
from functools import cache, partial
from typing import Any, NamedTuple

import gymnasium
import matplotlib.pyplot as plt
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicHermiteSpline

import flexarm_env
from flexarm_env import ArmParameters, FlexibleArm, LawParameters, SquareParameters, inverse_kinematics, square
from flexarm_env.parameters import Kinematics
from scripts.common.plotting import COLOURS, INK, SOFT, WIDTH, number_ticks
from tests.support.loops import resting_at
from tests.validation.conftest import Check, Page, checked
from tests.validation.motion import Array, bent_state
from tests.validation.small_motion import rate

pytestmark = pytest.mark.validation

Torque = Callable[[float, Array], Array]

TIME = 0.1  # [s]
CORNER = np.array([-6.3, -6.3])
PERIOD = 1e-3  # [s] control period of `FlexArm/Paper-v0`; all runs are compared at its instants
LAW = LawParameters()
DELAY = 4e-3  # [s]; a whole number of every step, so that no jump falls within one
bent = partial(bent_state, tips=(0.2, -0.1), rates=(0.5, -0.5))  # where runs of the linear arm begin
SOFT_GAIN, STIFF_GAIN = 0.02, 1.0  # gains lambda: fastest poles near -220 /s and -11 000 /s


class Study(NamedTuple):
    errors: Callable[[Array], list[float]]  # returns the error with each step
    longest: float  # step, halved three times [s]
    bounds: tuple[float, float]  # of the order
    reason: str  # of the bounds
    count: int = 4  # how many steps are tried

    @property
    def steps(self) -> Array:
        """The steps [s]."""
        return self.longest * 0.5 ** np.arange(self.count)


FOUR = "the classical Runge-Kutta method has order 4, and the problem is smooth within every step"
THREE = "ARS(4,4,3) has order 3 where the step resolves the law's fastest pole"
LATE = f"{THREE}; the delay line's cubic interpolation is of order 4"
STIFF = "steps about the fastest pole's time constant: between 3, the method's, and 2, its stages' plus one"
FORESHORTENED = "Runge-Kutta 4, torques held, foreshortened arm"
OF_FOUR, OF_THREE = (3.8, 4.3), (2.7, 3.3)
STUDIES = {
    "Runge-Kutta 4, torques held": Study(lambda h: held_torques(h, "linear"), 1e-3, OF_FOUR, FOUR),
    FORESHORTENED: Study(lambda h: held_torques(h, "foreshortened"), 1e-3, OF_FOUR, FOUR),
    "Runge-Kutta 4, torque a function": Study(lambda h: function_torque(h), 1e-3, OF_FOUR, FOUR),
    "Runge-Kutta 4 with the joint-space law": Study(lambda h: tracking_law(h), 2.5e-4, OF_FOUR, FOUR),
    "ARS(4,4,3), soft law": Study(lambda h: paper_law(h, SOFT_GAIN, 0.0), 5e-4, OF_THREE, THREE),
    "ARS(4,4,3), soft law, delayed sensor": Study(lambda h: paper_law(h, SOFT_GAIN, DELAY), 5e-4, OF_THREE, LATE),
    "ARS(4,4,3), stiff law": Study(lambda h: paper_law(h, STIFF_GAIN, 0.0), 5e-4, (1.7, 3.3), STIFF, count=3),
}


@cache
def errors(name: str) -> list[float]:
    return STUDIES[name].errors(STUDIES[name].steps)


def order(name: str) -> float:
    return rate(1.0 / STUDIES[name].steps, errors(name))


test_checks = checked(
    *(Check(f"{name}: order", partial(order, name), study.reason, "", *study.bounds) for name, study in STUDIES.items())
)


def test_picture(page: Page) -> None:
    figure, axis = plt.subplots(figsize=(WIDTH, 6.4))
    for (name, study), colour in zip(STUDIES.items(), (*COLOURS, INK), strict=False):
        axis.loglog(1e3 * study.steps, errors(name), "o-", color=colour, label=f"{name}: {order(name):.2f}")
    steps = np.array([0.03, 1.0])
    for power, height in ((4, 1e-3), (3, 3e-3)):
        axis.loglog(steps, height * steps**power, color=SOFT, linestyle=":")
        axis.annotate(f"order {power}", (steps[-1], height), xytext=(4, 0), textcoords="offset points", color=SOFT)
    axis.set(xlabel="step [ms]", ylabel="largest error / range [1]")
    number_ticks(axis.xaxis, (0.03125, 0.0625, 0.125, 0.25, 0.5, 1.0))
    axis.minorticks_off()
    figure.legend(loc="outside lower left")
    page.picture(figure, "orders", "Errors of the integrators by their step, with the observed orders")


def tight(slope: Callable[[float, Array], Array], start: Array, ends: Array) -> Array:
    """Solve a smooth problem; return states at the times `ends`, the first being the start. Shape (n, states)."""
    found = solve_ivp(slope, (ends[0], ends[-1]), start, "DOP853", ends, rtol=1e-11, atol=1e-13)
    return found.y.T


def worst(found: Array, expected: Array) -> float:
    """Largest error of any entry of the state over its range."""
    return float((np.abs(found - expected).max(axis=0) / np.ptp(expected, axis=0)).max())


def driven(arm: FlexibleArm, torque: Torque) -> Callable[[float, Array], Array]:
    return lambda t, x: np.concatenate([x[arm.size :], arm.acceleration(x, torque(t, x))])


def held_torques(steps: Array, kinematics: Kinematics) -> list[float]:
    """Integrate the linear arm by the compiled loop, with a torque for every 10 ms."""
    arm, period = FlexibleArm(ArmParameters.linear(kinematics=kinematics)), 1e-2
    torques = np.random.default_rng(1).uniform(-10.0, 10.0, (round(TIME / period), 2))
    state, expected = bent(arm), [bent(arm)]
    for tau in torques:
        state = tight(driven(arm, lambda t, x, tau=tau: tau), state, np.array([0.0, period]))[-1]  # type: ignore[misc]
        expected.append(state)
    runs = [arm.simulate(bent(arm), torques, TIME, period, round(period / h)) for h in steps]
    return [worst(run.state, np.array(expected)) for run in runs]


def function_torque(steps: Array) -> list[float]:
    """Integrate the linear arm under a torque of time and state, evaluated at every stage."""
    arm = FlexibleArm(ArmParameters.linear())

    def torque(t: float, x: Array) -> Array:
        rates = x[arm.size : arm.size + 2]
        return np.array([10.0 * np.sin(40.0 * t) - 2.0 * rates[0], 3.0 * np.cos(30.0 * t) - 0.5 * rates[1]])

    expected = tight(driven(arm, torque), bent(arm), np.linspace(0.0, TIME, round(TIME / PERIOD) + 1))
    runs = [arm.simulate(bent(arm), torque, TIME, PERIOD, round(PERIOD / h)) for h in steps]
    return [worst(run.state, expected) for run in runs]


ACTION = np.array([2.0**-6, -(2.0**-7)])  # held; the same in float32
LIMIT = (1000.0, 1000.0)  # [N m]; not reached, for it would be a kink within a step


def tracking_law(steps: Array) -> list[float]:
    """`FlexArm/SquareResidual-v0` with the linear arm from rest on a corner, its first 0.1 s.

    On the default arm the law's pole is ten times as fast, and no step that is stable is long enough to show an order.
    """
    given = {"arm": "linear", "elbow_branch": "positive", "torque_limit": LIMIT}
    envs = [gymnasium.make("FlexArm/SquareResidual-v0", physics_step=h, **given).unwrapped for h in steps]
    runs = [states_of(env, ACTION, start="corner") for env in envs]
    expected = _residual_expected(envs[0], runs[0][0])
    return [worst(run, expected) for run in runs]


def states_of(env: Any, action: Array, **begin: Any) -> Array:
    """States at control instants."""
    states = [env.reset(seed=0, options=begin)[1]["state"]]
    states += [env.step(action)[4]["state"] for _ in range(round(TIME / env.control_period))]
    return np.array(states)


def _residual_expected(env: Any, start: Array) -> Array:
    """Integrate from the law's definition: aims between control instants follow cubic Hermite polynomials."""
    arm, path, period = env.arm, square(SquareParameters()), env.control_period
    own = env.settings
    stiffness, resistance, limit = map(np.array, (own.inner_stiffness, own.inner_damping, own.torque_limit))
    turn = 2.0 * np.pi * np.round((start[:2] - _aim(arm, path, 0.0)[0]) / (2.0 * np.pi))
    states = [start]
    for k in range(round(TIME / period)):
        ends = np.array([0.0, period])
        aims = np.array([_aim(arm, path, k * period + u) for u in ends])
        spline = CubicHermiteSpline(ends, aims[:, 0] + turn, aims[:, 1])

        def torque(t: float, x: Array, spline: Any = spline) -> Array:
            wanted = limit * ACTION + stiffness * (spline(t) - x[:2])
            wanted += resistance * (spline(t, 1) - x[arm.size : arm.size + 2])
            return np.clip(wanted, -limit, limit)

        states.append(tight(driven(arm, torque), states[-1], ends)[-1])
    return np.array(states)


def _aim(arm: FlexibleArm, path: flexarm_env.ReferencePath, time: float) -> tuple[Array, Array]:
    """Joint angles and rates of the rigid arm on the path."""
    theta = inverse_kinematics(arm.parameters, path.position(time), "positive")
    return theta, np.asarray(np.linalg.solve(jacobian(arm, theta), path.velocity(time)))


def jacobian(arm: FlexibleArm, theta: Array) -> Array:
    """Of the rigid tip (13). Shape (2, 2)."""
    length1, length2 = arm.parameters.link_lengths
    one, both = theta[0], theta[0] + theta[1]
    second = length2 * np.array([-np.sin(both), np.cos(both)])
    return np.column_stack([length1 * np.array([-np.sin(one), np.cos(one)]) + second, second])


def paper_law(steps: Array, gain: float, delay: float) -> list[float]:
    """Hold the paper's arm on a corner from which it was moved away, by the law in continuous time."""
    arm = FlexibleArm(ArmParameters.paper())
    start = flexarm_env.rest_state(arm, CORNER)
    start[:2] += 0.1, -0.15
    if gain == STIFF_GAIN:  # the order of interest is that on a smooth solution: 50 ms later the fast part is gone
        start = law_solution(arm, start, gain, delay, 0.5 * TIME)[-1]
    expected = law_solution(arm, start, gain, delay, TIME)
    options: dict[str, Any] = {"delay": delay} if delay else {"sensor": "collocated"}
    options |= {"arm": arm.parameters, "gain_limit": gain, "max_episode_steps": -1} | resting_at(*CORNER)
    envs = [gymnasium.make("FlexArm/Paper-v0", physics_step=h, **options).unwrapped for h in steps]
    return [worst(states_of(env, np.ones(1, dtype=np.float32), state=start), expected) for env in envs]


def law_solution(arm: FlexibleArm, start: Array, gain: float, delay: float, time: float) -> Array:
    """Solve by the method of steps: lambda J^T (Kp e + Kd e'), e and e' of late angles and present rates."""

    def torque(x: Array, late: Array) -> Array:
        error = CORNER - arm.rigid_tip(np.concatenate([late, np.zeros(arm.size - 2)]))
        error_rate = -jacobian(arm, late) @ x[arm.size : arm.size + 2]
        force = LAW.proportional_gain * error + LAW.derivative_gain * error_rate
        return gain * jacobian(arm, x[:2]).T @ force

    part = delay or time
    times, states = PERIOD * np.arange(round(time / PERIOD) + 1), [start[None]]
    past: Callable[[float], Array] = lambda t: start  # noqa: E731  (before the start nothing moves)
    for begin in np.arange(0.0, time - 1e-9, part):
        inside = times[(times > begin + 1e-9) & (times < begin + part + 1e-9)]
        end = begin + part

        def slope(t: float, x: Array, past: Callable[[float], Array] = past) -> Array:
            late = past(t - delay)[:2] if delay else x[:2]
            return np.concatenate([x[arm.size :], arm.acceleration(x, torque(x, late))])

        found = solve_ivp(slope, (begin, end), states[-1][-1], "DOP853", rtol=1e-11, atol=1e-13, dense_output=True)
        states.append(found.sol(inside).T)
        states[-1][-1] = found.y[:, -1]
        past = found.sol
    return np.concatenate(states)

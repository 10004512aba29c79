"""The arm as a planar chain of rigid segments in MuJoCo: another discretisation, by another engine.

The standard finite-segment method (Huston 1981; Yoshikawa and Hosoda 1996 call it "virtual passive joints"): a link of
length L is cut into n - 1 elements of length h = L / (n - 1), and the bending of each is lumped into a hinge with a
torsion spring EI / h at its *middle*. So n rigid segments stand between the springs, the first and the last half as
long as the others. This is the midpoint rule for the curvature, with the second order in h; springs at the borders of
n equal segments would lose the compliance next to the clamp, and with it one order. n = 10 puts the first clamped
frequency 0.28 % too high, n = 20 0.064 %.

Shoulder and elbow are free hinges with motors; a link has n degrees of freedom, its root's hinge included. theta1 is
the angle of link 1's first segment from the x axis, theta2 that of link 2's first from link 1's last: as in FlexArm,
from tangent to tangent. No gravity, no contacts.

**Damping.** As `ArmParameters.damping_model` says (`physics.damping`). "material": dampers in the hinges in proportion
to the springs, c = beta EI / h. "modal": every mode that the segments of a clamped bare link have is damped by the
ratio r, as FlexArm damps those that it has, C = M Phi diag(2 r omega_i) Phi' M with Phi' M Phi = 1. A term of this
matrix, 2 r omega_i (M phi_i) (M phi_i)', is what MuJoCo calls a fixed tendon with a damper. Of `ArmParameters` the
chain needs neither modes nor their scale, and its velocity forces are complete whatever `velocity_forces` says.

**Time step.** `implicitfast` treats dampers implicitly and springs explicitly, semi-implicit Euler: without damping it
is stable up to 2 / omega_max, that is 0.5 ms for n = 10 and 0.1 ms for n = 20 of `TIME_STEPS`. Dampers with beta >=
step / 2 ("material") make it stable at any frequency: for the default arm up to 0.99 ms, whatever n is.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Collection, Sequence

import mujoco
import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh

from flexarm_env.parameters import ArmParameters
from flexarm_env.physics.damping import clamped_ratio, material_time
from flexarm_env.validation import instance, integer, number

TIME_STEPS = (5e-3, 2e-3, 1e-3, 5e-4, 2e-4, 1e-4, 5e-5, 2e-5)  # [s]; `largest_stable_step` tries these
SHOULDER, ELBOW, TIP = "shoulder", "elbow", "tip"
MOST_STEPS = 1000  # of `stable_steps`
_MARGIN = 1.1  # of the longest stable step of the straight chain over the one that is taken
_ROUNDING = 1e-6  # of an eigenvalue; the rigid motions' is double, which costs half of the digits
_SLENDER = 1e-6  # a rod's inertia about its own axis as a part of the other two; MuJoCo requires it to be positive


def chain_model(segments: int, arm: ArmParameters | None = None, time_step: float = 2e-4) -> mujoco.MjModel:
    """Build the chain.

    Joints are named "shoulder", "elbow" and "bend1_1" ... "bend2_9" (link, then from root to tip); actuators "shoulder"
    and "elbow" take torques [N m]; the site "tip" is the end of link 2.

    Args:
        segments: rigid segments a link, at least 2.
        arm: the arm; None for the default one.
        time_step: [s].

    Raises:
        TypeError, ValueError: for fewer than 2 segments, another bad argument, or an arm with dry friction.
    """
    return mujoco.MjModel.from_xml_string(chain_xml(segments, arm, time_step))


def chain_xml(segments: int, arm: ArmParameters | None = None, time_step: float = 2e-4) -> str:
    """Write the chain in MuJoCo's own format; arguments and errors as in `chain_model`."""
    segments, step = integer("segments", segments, 2), number("time_step", time_step, "s", above=0.0)
    arm = ArmParameters() if arm is None else arm
    instance("arm", arm, ArmParameters)
    if any(arm.breakaway):
        raise ValueError(f"coulomb_friction = {arm.coulomb_friction} N m: the chain has no dry friction; must be 0")
    first, mount = _link(arm, 0, segments, 0.0)
    second, tip = _link(arm, 1, segments, mount)
    modal = arm.damping_model == "modal"
    tendons = "\n".join(_mode_dampers(arm, link, segments) for link in (0, 1)) if modal else ""
    return f"""
    <mujoco model="flexible arm of two links">
      <compiler angle="radian"/>
      <option timestep="{step!r}" integrator="implicitfast">
        <flag gravity="disable" constraint="disable" contact="disable" autoreset="disable"/>
      </option>
      <worldbody>
        {first}
        {second}
        <site name="{TIP}" pos="{tip!r} 0 0"/>
        {"</body>" * (2 * segments)}
      </worldbody>
      <tendon>{tendons}</tendon>
      <actuator>
        <motor name="{SHOULDER}" joint="{SHOULDER}"/>
        <motor name="{ELBOW}" joint="{ELBOW}"/>
      </actuator>
    </mujoco>"""


def _link(arm: ArmParameters, link: int, segments: int, mount: float) -> tuple[str, float]:
    """Write the bodies of link 0 or 1, left open for what comes after; return the last segment's length [m], too.

    The link's root lies `mount` behind the hinge before it, along the segment that carries it [m].
    """
    element = arm.link_lengths[link] / (segments - 1)
    rho, stiffness = arm.masses_per_length[link], arm.flexural_rigidities[link] / element
    damping = material_time(arm) * stiffness if arm.damping_model == "material" else 0.0
    hub = (arm.shoulder_hub_inertia, arm.elbow_hub_inertia)[link]
    mass, inertia = ((arm.elbow_mass, arm.elbow_housing_inertia), (arm.payload_mass, arm.payload_inertia))[link]
    lines = []
    for k in range(segments):
        is_root, is_last = k == 0, k == segments - 1
        length = 0.5 * element if is_root or is_last else element
        name = (SHOULDER, ELBOW)[link] if is_root else f"bend{link + 1}_{k}"
        spring = (0.0, arm.joint_friction[link]) if is_root else (stiffness, damping)
        inertial = _inertial(rho * length, length, mass * is_last, hub * is_root + inertia * is_last)
        lines.append(
            f'<body pos="{mount!r} 0 0">{inertial}'
            f'<joint name="{name}" axis="0 0 1" stiffness="{spring[0]!r}" damping="{spring[1]!r}"/>'
        )
        mount = length
    return "\n".join(lines), mount


def _mode_dampers(arm: ArmParameters, link: int, segments: int) -> str:
    """Write a fixed tendon with a damper for each mode of a clamped bare link."""
    mass = clamped_mass(arm.link_lengths[link], arm.masses_per_length[link], segments)
    stiffness = arm.flexural_rigidities[link] * (segments - 1) / arm.link_lengths[link]
    squares, shapes = eigh(stiffness * np.eye(segments - 1), mass)  # shapes' M shapes = 1
    lines, ratio = [], clamped_ratio(arm)
    for k, (square, pull) in enumerate(zip(squares, (mass @ shapes).T, strict=True)):
        joints = [f'<joint joint="bend{link + 1}_{j + 1}" coef="{float(c)!r}"/>' for j, c in enumerate(pull)]
        damper = 2.0 * ratio * math.sqrt(square)
        lines.append(f'<fixed name="mode{link + 1}_{k + 1}" damping="{damper!r}">{"".join(joints)}</fixed>')
    return "\n".join(lines)


def clamped_mass(length: float, rho: float, segments: int) -> NDArray[np.float64]:
    """Return the mass matrix of a clamped bare link in its bend angles [kg m^2]. Shape (segments - 1, segments - 1).

    Args:
        length: length of the link [m].
        rho: mass per length [kg/m].
        segments: number of rigid segments; the first is the clamp's.
    """
    lengths = np.full(segments - 1, length / (segments - 1))
    lengths[-1] *= 0.5
    turned = np.tril(np.ones((segments - 1, segments - 1)))  # angles of the segments from the bend angles
    ends = np.cumsum(lengths[:, None] * turned, axis=0)  # how far the segments' ends move across
    centres = ends - 0.5 * lengths[:, None] * turned
    masses = rho * lengths
    return centres.T * masses @ centres + turned.T * (masses * lengths**2 / 12.0) @ turned


def _inertial(rod: float, length: float, mass: float, inertia: float) -> str:
    """Write a uniform rod [kg, m] with a point mass at its end [kg] and a further inertia [kg m^2]."""
    total = rod + mass
    centre = length * (0.5 * rod + mass) / total
    about_root = length**2 * (rod / 3.0 + mass) + inertia
    turning = about_root - total * centre**2
    moments = f"{_SLENDER * turning!r} {turning!r} {turning!r}"
    return f'<inertial pos="{centre!r} 0 0" mass="{total!r}" diaginertia="{moments}"/>'


# --- looking at a chain -----------------------------------------------------------------------------------------------


def frequencies(model: mujoco.MjModel, locked: Collection[str] = ()) -> NDArray[np.float64]:
    """Return the undamped angular frequencies of the straight chain about rest, lowest first [rad/s].

    Args:
        model: the chain.
        locked: names of joints that are held; a free shoulder or elbow gives a zero.
    """
    mass = mass_matrix(model)
    free = [k for k in range(model.nv) if model.joint(k).name not in locked]  # a hinge has one degree of freedom
    squares = eigh(_springs(model)[np.ix_(free, free)], mass[np.ix_(free, free)], eigvals_only=True)
    return np.sqrt(np.maximum(squares, 0.0))


def mass_matrix(model: mujoco.MjModel) -> NDArray[np.float64]:
    """Return the mass matrix of the straight chain in its joint angles [kg m^2]. Shape (2 segments, 2 segments)."""
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    mass = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, mass)
    return mass


def dampers(model: mujoco.MjModel) -> NDArray[np.float64]:
    """Return the damping matrix of the unbent chain in its joint angles [N m s]. Shape (2 segments, 2 segments)."""
    data, columns = mujoco.MjData(model), []
    for rates in np.eye(model.nv):
        data.qvel[:] = rates
        mujoco.mj_forward(model, data)
        columns.append(-data.qfrc_passive.copy())
    return np.array(columns).T


def _springs(model: mujoco.MjModel) -> NDArray[np.float64]:
    return np.diag([model.joint(k).stiffness[0] for k in range(model.nv)])


# --- the time step ----------------------------------------------------------------------------------------------------


def stable_steps(model: mujoco.MjModel, time: float, longest: float) -> int:
    """Return the least number of equal steps in some time with which the linear chain does not grow by itself.

    Args:
        model: the chain.
        time: to be divided [s].
        longest: step that is to be taken where it is stable [s].

    Raises:
        ValueError: if more than `MOST_STEPS` are needed.
    """
    omega = float(frequencies(model)[-1])
    fewest = count = math.ceil(time / longest * (1.0 - _ROUNDING))

    def is_enough(steps: int) -> bool:
        return growth(model, _MARGIN * time / steps) <= 1.0 + _ROUNDING

    if not is_enough(count):  # enough without dampers, which seldom ask for more
        count = max(count, math.ceil(_MARGIN * time * omega / 2.0))
    while count <= MOST_STEPS and not is_enough(count):
        count = math.ceil(1.2 * count)
    if count > MOST_STEPS:
        raise ValueError(
            f"segments, arm: the chain's fastest vibration, {omega:.3g} rad/s, and the step that was asked for, "
            f"{longest:g} s, take more than {MOST_STEPS} steps in {time:g} s; take fewer segments, a less "
            "stiff arm, more damping in the hinges, or a longer step"
        )
    return fewest + bisect_left(range(fewest, count), True, key=is_enough)


def growth(model: mujoco.MjModel, step: float) -> float:
    """Return the factor by which a step multiplies a small motion of the straight chain; 1 for its rigid motions.

    Args:
        model: the chain.
        step: step of semi-implicit Euler with implicit dampers [s].
    """
    mass = mass_matrix(model)
    rates = np.linalg.solve(mass + step * dampers(model), np.hstack((-step * _springs(model), mass)))
    angles = np.eye(model.nv, 2 * model.nv) + step * rates
    return float(np.abs(np.linalg.eigvals(np.vstack((angles, rates)))).max())


def largest_stable_step(segments: int, arm: ArmParameters | None = None, steps: Sequence[float] = TIME_STEPS) -> float:
    """Find the first of `steps` with which the linear chain does not grow by itself [s].

    Args:
        segments: rigid segments a link.
        arm: the arm; None for the default one.
        steps: largest first [s].

    Raises:
        ValueError: if there is none.
    """
    model = chain_model(segments, arm)
    for step in steps:
        if growth(model, step) <= 1.0 + _ROUNDING:
            return step
    raise ValueError(f"segments = {segments}: unstable with each step of {tuple(steps)} s")

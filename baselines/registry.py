"""Controllers by name: what each is, which options of an environment it needs, and where it comes from.

A new controller is a class with `options` and `for_env` (docs/controllers.md) and an entry here. What it reads follows
from the observation that its options select (`flexarm_env.envs.observation.readings_of`) and from `knows`.

All names, and one of them in an environment that delivers what it reads:

    >>> import gymnasium
    >>> controller_names()[:3]
    ('ifdc', 'flsac', 'joint_pd')
    >>> env = gymnasium.make("flexarm_env:FlexArm/Square-v0", **controller("ifdc").options)
    >>> action, memory = make_controller("ifdc", env).predict(env.reset(seed=0)[0])
    >>> action.shape  # the gain of the paper's law
    (1,)
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar, Protocol

from flexarm_baselines.gauged_tracking import GaugedTracking
from flexarm_baselines.joint_space.disturbance_observer import ObservedTracking
from flexarm_baselines.joint_space.tracking import DECOUPLED, STIFF, JointTracking
from flexarm_baselines.lqg import LQG, AdaptiveLQG, GaugedLQG, HInfinityLQG, InertialLQG, RaceLQG, StampedLQG
from flexarm_baselines.lqg.race_paced import PacedAdaptiveLQG
from flexarm_baselines.paper_law.flsac import FLSAC
from flexarm_baselines.paper_law.ifdc import IFDC
from flexarm_baselines.plan_follower import PlanFollower
from flexarm_baselines.policy import Policy
from flexarm_baselines.predictive import DOUBTFUL, NMPC, SOFT, STAMPED, UNKNOWN, StampedNMPC, StateNMPC
from flexarm_baselines.race_mpcc import RaceMPCC
from flexarm_env.validation import choice


class Kind(Protocol):
    """A class of controllers.

    Attributes:
        knows: its inputs beside the observation; see `controller.TorqueController`.
    """

    knows: ClassVar[tuple[str, ...]]

    @classmethod
    def options(cls) -> dict[str, Any]:
        """Return the options with which an environment gives the controller what it reads."""

    @classmethod
    def for_env(cls, env: Any) -> Policy:
        """Make the controller for an environment, single or vector."""


@dataclass(frozen=True)
class Controller:
    """An entry of the registry.

    Attributes:
        kind: class of the controller.
        text: description in one line.
        source: publication that it follows.
        design: keyword arguments of `for_env`.
        environment: id of the environment that it is made for.
    """

    kind: type[Kind]
    text: str
    source: str
    design: Mapping[str, Any] = field(default_factory=dict)
    environment: str = "FlexArm/Square-v0"

    @property
    def options(self) -> dict[str, Any]:
        """Options that an environment needs for it."""
        return self.kind.options()

    def make(self, env: Any, **design: Any) -> Policy:
        """Make the controller for an environment, single or vector, that was made with `options`.

        Args:
            env: a FlexArm environment.
            **design: keyword arguments of `for_env`, in the place of the entry's own.
        """
        return self.kind.for_env(env, **{**self.design, **design})


BAYO = "Bayo, J. Robotic Systems 4, 1987"
ANDERSON_MOORE = "Anderson & Moore, Optimal Control: Linear Quadratic Methods, 1990"
DAHL = "Dahl & Nielsen, IEEE Trans. Robotics and Automation 6, 1990"
DIEHL = "Diehl, Bock & Schloeder, SIAM J. Control and Optimization 43, 2005"
LAM = "Lam, Manzie & Good, CDC 2010; Liniger, Domahidi & Morari, Optimal Control Applications and Methods 36, 2015"
LJUNG = "Ljung, IEEE Trans. Automatic Control 24, 1979"
GREEN_SASIADEK = "Green & Sasiadek, IFAC World Congress 2008"

CONTROLLERS: dict[str, Controller] = {
    "ifdc": Controller(IFDC, "the paper's Jacobian-transpose law with a constant gain of 1", GREEN_SASIADEK),
    "flsac": Controller(FLSAC, "the paper's law with a fuzzy gain from the links' deflections", GREEN_SASIADEK),
    "joint_pd": Controller(
        JointTracking,
        "filtered joint feedback on the inverse kinematics of the corner-blended reference",
        "Takegaki & Arimoto, J. Dynamic Systems, Measurement, and Control 103, 1981",
        {"feedforward": "none", "feedback": STIFF},
    ),
    "computed_torque": Controller(
        JointTracking,
        "inverse dynamics of the rigid arm, with filtered joint feedback through its mass matrix",
        "Luh, Walker & Paul, IEEE Trans. Automatic Control 25, 1980",
        {"feedforward": "rigid", "feedback": DECOUPLED},
    ),
    "computed_torque_dob": Controller(
        ObservedTracking,
        "as `computed_torque`, less the torque that a disturbance observer finds from the rigid arm's momenta",
        "Chen, Ballance, Gawthrop & O'Reilly, IEEE Trans. Industrial Electronics 47, 2000",
    ),
    "shaped": Controller(
        JointTracking,
        "command shaping: a corner-blended reference, feed-forward of the bending arm, filtered joint feedback",
        f"Banerjee & Singhose, J. Guidance, Control, and Dynamics 21, 1998; {BAYO}",
    ),
    "shaped_gauges": Controller(
        GaugedTracking,
        "as `shaped`, with linear-quadratic feedback of the state that encoders and strain gauges read",
        f"Banerjee & Singhose, J. Guidance, Control, and Dynamics 21, 1998; {ANDERSON_MOORE}, chapter 3",
    ),
    "plan_lqr": Controller(
        PlanFollower,
        "time-varying LQR of the true state along the best known plan: privileged, a yardstick",
        f"{ANDERSON_MOORE}, chapter 3",
    ),
    "lqg": Controller(
        LQG,
        "time-varying LQR along the best known plan, of the state that a Kalman filter estimates from encoders and the "
        "late tip",
        f"{ANDERSON_MOORE}, chapter 8",
    ),
    "lqg_gauges": Controller(GaugedLQG, "as `lqg`, with strain gauges", f"{ANDERSON_MOORE}, chapter 8"),
    "lqg_imu": Controller(
        InertialLQG,
        "as `lqg`, with an accelerometer and a gyro at the tip",
        f"{ANDERSON_MOORE}, chapter 8; Titterton & Weston, Strapdown inertial navigation technology, 2004",
    ),
    "hinf": Controller(
        HInfinityLQG,
        "the central H-infinity controller along the best known plan, from encoders and the late tip",
        "Basar & Bernhard, H-infinity-optimal control and related minimax design problems, 1995; Whittle, "
        "Risk-sensitive optimal control, 1990",
    ),
    "lqg_adaptive": Controller(
        AdaptiveLQG,
        "as `lqg`, with a bank of filters that also estimate payload, stiffness, damping and the delays of sensor and "
        "motors",
        f"{LJUNG}; Friedland, IEEE Trans. Automatic Control 14, 1969; Magill, IEEE Trans. Automatic Control 10, 1965",
    ),
    "lqg_adaptive_stamped": Controller(
        StampedLQG, "as `lqg_adaptive`, with time stamps of the late tip in the place of its estimated delay", LJUNG
    ),
    "race_lqg": Controller(
        RaceLQG,
        "`lqg` along the best known plan of a race, with the plan's speeds of the reference",
        f"{ANDERSON_MOORE}, chapter 8",
        environment="FlexArm/Race-v0",
    ),
    "race_lqg_adaptive": Controller(
        PacedAdaptiveLQG,
        "`lqg_adaptive` along a slower plan of a race, which waits for the arm, and the reference with it",
        f"{DAHL}; {LJUNG}",
        {"plan": "steady"},
        "FlexArm/Race-v0",
    ),
    "race_mpcc": Controller(
        RaceMPCC,
        "model predictive contouring control: as `nmpc_adaptive`, with the progress along the plan as a third input",
        LAM,
        {"plan": "steady"},
        "FlexArm/Race-v0",
    ),
    "nmpc": Controller(
        NMPC,
        "nonlinear predictive control about the best known plan, of the state that a Kalman filter estimates from "
        "encoders and the late tip",
        DIEHL,
    ),
    "nmpc_adaptive": Controller(
        NMPC,
        "as `nmpc`, with a filter that also estimates payload, stiffness and the sensor's delay",
        f"{DIEHL}; {LJUNG}",
        {"unknown": UNKNOWN, "noise": DOUBTFUL},
    ),
    "nmpc_adaptive_stamped": Controller(
        StampedNMPC,
        "as `nmpc_adaptive`, with time stamps of the late tip in the place of its estimated delay",
        f"{DIEHL}; {LJUNG}",
        {"unknown": STAMPED, "noise": DOUBTFUL},
    ),
    "nmpc_deflection": Controller(
        NMPC,
        "as `nmpc`, with the links' deflections kept below 1.2 m by a soft constraint",
        f"{DIEHL}; Kerrigan & Maciejowski, UKACC Control 2000",
        {"deflection_limit": SOFT},
    ),
    "nmpc_path": Controller(
        NMPC, "as `nmpc`, about a run of its own that is not optimised", DIEHL, {"reference": "path"}
    ),
    "nmpc_state": Controller(StateNMPC, "as `nmpc`, of the true state: privileged, a yardstick", DIEHL),
}


def controller_names() -> tuple[str, ...]:
    """Return the names of all controllers."""
    return tuple(CONTROLLERS)


def controller(name: str) -> Controller:
    """Return the entry of a controller."""
    return CONTROLLERS[choice("name", name, controller_names())]


def make_controller(name: str, env: Any, **design: Any) -> Policy:
    """Make a controller by its name, for an environment that was made with `controller(name).options`.

    Args:
        name: a name of `controller_names`.
        env: a FlexArm environment, single or vector.
        **design: what its class's `for_env` takes beside the environment.
    """
    return controller(name).make(env, **design)

"""`SafetyFilter`: a network whose torques act as long as a backup law is predicted to hold the arm after them.

Sources: Wabersich and Zeilinger, *A predictive safety filter for learning-based control of constrained nonlinear
dynamical systems*, Automatica 129, 2021; Seto, Krogh, Sha and Chutinan, *The simplex architecture for safe online
control system upgrades*, ACC 1998 (which switches to a backup law).
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, ClassVar, Self

import numpy as np

from flexarm_agents.environments import settings_of
from flexarm_agents.policies.load import load_policy, policy_file
from flexarm_baselines.arrays import Array, Bools, Floats
from flexarm_baselines.controller import Memory, Seen
from flexarm_baselines.lqg.adaptive import AdaptiveLQG, Beliefs
from flexarm_baselines.policy import Policy, env_attribute
from flexarm_baselines.task import Task
from flexarm_env.envs.blocks import BLOCKS
from flexarm_env.envs.sensors import VECTOR
from flexarm_env.envs.settings import Settings
from flexarm_env.simulation.open_loop import LARGEST
from flexarm_env.validation import number

SHARES = (0.25, 0.5, 0.75, 1.0)  # of the way from the backup's torques to the network's
# Control periods of a prediction: a period of the slowest vibration of the unknown arms with free joints, 0.19 s, in
# which a link bends furthest.
HORIZON = 20
OWN = 9  # parts of the backup's memory


# Share of the limits of the tip's error and the links' bending in which predictions must stay: 0.1 less than the
# largest at which hardly an arm of a sample is lost (`python -m scripts.control --only safety_filter`)
TUBE = 0.4


def trained_on(network: str) -> Settings:
    """Return the settings of the environment that a shipped policy was trained on."""
    trained = load_policy(network)
    return settings_of(trained.environment, trained.options)


class SafetyFilter(AdaptiveLQG):
    """A shipped policy, with `AdaptiveLQG` for a backup.

    In each control period the network proposes torques. They are projected on the set that is predicted to be safe,
    along the line to the backup's torques: the largest of `SHARES` acts that is safe, and the backup where none is. A
    share is safe if, with its torques for a period and the backup's feedback after that, the tip's error and the links'
    bending at the next `HORIZON` instants are below `TUBE` times the limits that end an episode. The prediction is by
    the backup's own model for its present estimates, linear about the plan of the nearest node.

    A memory is that of the backup, the share that acts (NaN: none yet), Shape (n,), and the network's memory.

    Attributes:
        network: name of the shipped policy.
        limits: of predicted error and bending [m].
    """

    network: ClassVar[str] = "student"
    blocks: ClassVar[tuple[str, ...]] = tuple(dict.fromkeys((*AdaptiveLQG.blocks, *trained_on("student").observation)))

    def __init__(
        self, task: Task, limits: tuple[float | None, float | None], policy: Policy | None = None, tube: float = TUBE
    ) -> None:
        """Design the backup, and load the network.

        Args:
            task: see `Task`.
            limits: error and bending that end an episode [m]; None: there is no such limit.
            policy: proposes in the place of the network, from the same observation.
            tube: share of them in which predictions must stay.
        """
        super().__init__(task)
        known = [np.inf if limit is None else limit for limit in limits]
        self.limits = number("tube", tube, above=0.0) * np.array(known)
        self._policy: Any = policy or load_policy(self.network).policy
        self._own, self._reference = trained_on(self.network), task.reference

    @classmethod
    def options(cls) -> dict[str, Any]:
        """Return the options with which an environment gives network and backup what they read."""
        own = trained_on(cls.network)
        return super().options() | {"scaled": own.scaled, "previews": own.previews, "last_actions": own.last_actions}

    @classmethod
    def for_env(cls, env: Any, **design: Any) -> Self:
        """Make the filter for an environment that was made with `options()`; see `TorqueController.for_env`."""
        settings = env_attribute(env, "settings")
        return cls(Task.of(env), (settings.error_limit, settings.deflection_limit), **design)

    @property
    def files(self) -> tuple[Path, ...]:
        """The network's file."""
        return (policy_file(self.network),)

    def start(self, seen: Seen) -> Memory:
        """Begin the backup and the network."""
        network = self._policy.predict(self.shown(seen))[1] or ()
        return (*super().start(seen), np.full(len(seen), np.nan), *network)

    def torque(self, seen: Seen, memory: Memory) -> tuple[Floats, Memory]:
        """Return the torques nearest to the network's that are predicted to be safe."""
        begins, network = np.isnan(memory[OWN]), memory[OWN + 1 :]
        backup, after = super().torque(seen, memory[:OWN])
        action, network = self._policy.predict(self.shown(seen), network or None, begins)
        change, period = np.asarray(self.task.torque_limit) * action - backup, self.period_of(seen)
        lanes, shares = np.repeat(np.arange(len(seen)), len(SHARES)), np.tile(SHARES, len(seen))
        tried = backup[lanes] + shares[:, None] * change[lanes]
        acted = self._followed_by(period[lanes], tuple(part[lanes] for part in after), tried)
        passing = shares * self.safe(self.predicted(period[lanes], acted))
        share = np.max(passing.reshape(len(seen), -1), axis=1)
        torque = backup + share[:, None] * change
        return torque, (*self._followed_by(period, after, torque), share, *(network or ()))

    def safe(self, worst: Floats) -> Bools:
        """Return whether proposals are safe, by their largest predicted error and bending (n, 2) [m]. Shape (n,)."""
        return np.asarray(np.all(worst < self.limits, axis=1))

    def predicted(self, period: Array, after: Memory) -> Floats:
        """Return the largest error and bending of a horizon of the backup, within the lap [m]. Shape (n, 2).

        Args:
            period: number of the control period at whose end the prediction begins. Shape (n,).
            after: the backup's memory at that instant.
        """
        arms, last, arm = np.arange(len(period)), self.task.periods, self.plans[0].arm
        estimate, late = after[0][arms, after[7]], after[1][arms, after[7]][:, None] / self.task.period
        node, before, states = self._nearest_node(after[4], estimate), after[5], []
        periods = period + np.arange(1, HORIZON + 1)[:, None]
        for now in np.minimum(periods, last - 1):
            states.append(estimate[:, : arm.size].astype(np.float64))
            off = (estimate - self.filter.nominal[node, now])[:, : self._of_the_arm]
            torque = self.limited(self.regulator.torques((node, now), off, before, late, off[:, :0]))
            estimate, before = self.filter.predict((node, now), estimate, before, torque, late), torque
        q = np.nan_to_num(np.array(states), nan=LARGEST).clip(-LARGEST, LARGEST)
        away = np.linalg.norm(arm.tip(q) - self._reference[np.minimum(periods, last)], axis=-1)
        both = np.stack([away, np.abs(arm.tip_deflection(q)).max(axis=-1)], axis=-1)
        return np.asarray(np.max(both, axis=0, where=(periods <= last)[..., None], initial=0.0))

    def shown(self, seen: Seen) -> Array:
        """Return what the network observes, vectors in the frame that it knows. Shape (n, k)."""
        angle = seen["joint_angles"][:, :1] * (self._own.frame == "link")
        cosine, sine, found = np.cos(angle), np.sin(angle), []
        for name in self._own.observation:
            values, block = seen.observations[:, self.task.blocks[name]].astype(np.float64), BLOCKS[name]
            if block.mirror == VECTOR and block.unit in ("m", "m/s"):
                x, y = values[:, ::2], values[:, 1::2]
                values = np.stack([cosine * x + sine * y, cosine * y - sine * x], axis=2).reshape(values.shape)
            found.append(values)
        return np.concatenate(found, axis=1).astype(np.float32)

    def _followed_by(self, period: Array, after: Memory, torque: Floats) -> Memory:
        """Return the backup's memory after a period in which other torques act than its own [N m]. Shape (n, 2)."""
        beliefs, (chosen, backup, doubt, *rest) = Beliefs(*after[:4]).flat(), after[4:]
        arms = np.repeat(np.arange(len(doubt)), doubt.shape[1])
        # the node is that of the period: a prediction leaves the estimates of payload and stiffness as they are
        at, share = (self._nearest_node(chosen[arms], beliefs.estimate), period[arms]), beliefs.late[:, None]
        moves = [(backup[arms], one[arms], share / self.task.period) for one in (torque, backup)]
        estimate, slope = (
            value + moved(at, value, *moves[0]) - moved(at, value, *moves[1])
            for value, moved in ((beliefs.estimate, self.filter.predict), (beliefs.slope, self.filter.by_lateness))
        )
        beliefs = beliefs._replace(estimate=estimate, slope=slope)
        return (*beliefs.by_arm(len(doubt)), chosen, torque, doubt, *rest)

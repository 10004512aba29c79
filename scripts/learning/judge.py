"""`Judge`: scores a policy during a training, and keeps the best one."""

from copy import deepcopy
from typing import Any

from flexarm_agents import StandardScore, evaluate
from flexarm_agents.environments import make_one
from flexarm_agents.evaluation.scoring import rank
from flexarm_agents.policies.network import NetworkPolicy
from flexarm_agents.training.config import RunConfig
from flexarm_agents.training.loop import EVALUATION_SEED

Outcome = tuple[NetworkPolicy, StandardScore, list[dict[str, Any]]]  # see `Judge.outcome`


class Judge:
    """What a training has reached.

    Attributes:
        curve: the score of each evaluation, with the `steps` before it.
    """

    def __init__(self, config: RunConfig) -> None:
        self.curve: list[dict[str, Any]] = []
        self._config = config
        self._best: tuple[tuple[int, float], NetworkPolicy, StandardScore] | None = None

    def judge(self, policy: NetworkPolicy, steps: int) -> None:
        """Evaluate a policy, and keep a copy of it if it is the best."""
        with make_one(self._config.environment, self._config.options) as env:
            scores = [evaluate(env, policy, EVALUATION_SEED + n) for n in range(self._config.evaluation_laps)]
        self.curve.append({"steps": steps, **scores[0].as_mapping()})
        ranked = rank(scores)
        if self._best is None or ranked < self._best[0]:
            self._best = ranked, deepcopy(policy), scores[0]  # what is learned beside it goes on

    def outcome(self) -> Outcome:
        """Return the best policy, its score, and the curve."""
        assert self._best is not None
        _, policy, score = self._best
        return policy, score, self.curve

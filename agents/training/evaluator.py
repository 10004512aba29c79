"""`Evaluator`: scores a policy between two parts of its training, and keeps the best one."""

from __future__ import annotations

import json
import logging
from dataclasses import dataclass, field, replace
from typing import Any

from stable_baselines3.common.logger import Logger

from flexarm_agents.environments import make_one
from flexarm_agents.evaluation.scoring import StandardScore, evaluate, rank
from flexarm_agents.files import put
from flexarm_agents.policies.network import NetworkPolicy
from flexarm_agents.training.config import RunConfig
from flexarm_agents.training.run_folder import RunFolder

_log = logging.getLogger(__name__)
EVALUATION_SEED = 1_000_003  # not one of the training's, for any small seed
WORST = (2**31, 0.0)  # a rank that every evaluation beats


@dataclass(kw_only=True)
class TrainingProgress:
    """What a training found so far, and when the next evaluation and checkpoint are due.

    Attributes:
        rows: rows of the evaluations.
        best: index of the best row, None before the first.
        best_rank: rank of that row, see `scoring.rank`.
        seconds: wall time of the training, compiling and evaluations included, in this process and those
            before [s].
        next_evaluation: steps at which it is due; None before the first.
        next_checkpoint: steps at which it is due; None before the first.
    """

    rows: list[dict[str, Any]] = field(default_factory=list)
    best: int | None = None
    best_rank: tuple[int, float] = WORST
    seconds: float = 0.0
    next_evaluation: int | None = None
    next_checkpoint: int | None = None

    @property
    def state(self) -> str:
        """The best evaluation in a few words."""
        return f"best {self.best_rank[1]:.3f} m" if self.best_rank[0] == 0 else "none with complete laps yet"


class Evaluator:
    """Laps of a policy in training, on the environment that it is trained on."""

    def __init__(self, config: RunConfig, run: RunFolder, found: TrainingProgress) -> None:
        """Make the environment.

        Args:
            config: of the training.
            run: folder of the training.
            found: kept up to date here.
        """
        self._config, self._run, self.found = config, run, found
        self._env = make_one(config.environment, config.options)
        self._versions = json.loads(run.versions.read_text())

    def judge(self, policy: NetworkPolicy, steps: int, logger: Logger) -> bool:
        """Score a policy, log the figures, and save it if it is the best so far.

        Args:
            policy: of the training.
            steps: environment steps of the training so far.
            logger: for TensorBoard.

        Returns:
            Whether it is the best so far.
        """
        found = self.found
        scores = [evaluate(self._env, policy, EVALUATION_SEED + n) for n in range(self._config.evaluation_laps)]
        worst = StandardScore(*(max(laps, key=lambda lap: lap.rank) for laps in zip(*scores, strict=True)))
        row = {"steps": steps, "seconds": round(found.seconds, 2), **worst.as_mapping()}
        found.rows.append(row)
        for lap, figures in worst.as_mapping().items():
            for name in ("rms", "maximum", "rms_after_2s", "duration"):
                if figures[name] is not None:
                    logger.record(f"evaluation/{lap}/{name}", figures[name])
        logger.dump(steps)
        self._run.write_evaluations(found.rows)
        is_best = (of_these := rank(scores)) < found.best_rank
        if is_best:
            found.best, found.best_rank = len(found.rows) - 1, of_these
            put(self._run.best, self.noted(policy).save)
        return is_best

    def report(self) -> None:
        """Log the last evaluation in a line."""
        row = self.found.rows[-1]
        _log.info(
            "%9d steps  %6.0f s  %s; %s", row["steps"], self.found.seconds, StandardScore.of(row), self.found.state
        )

    def noted(self, policy: NetworkPolicy) -> NetworkPolicy:
        """Return the policy that was judged last, with notes of what it was trained on and of its scores."""
        notes = {"config": self._config.plain(), "evaluation": self.found.rows[-1], "versions": self._versions}
        return replace(policy, notes=notes)

    def close(self) -> None:
        """Let go of the environment."""
        self._env.close()

"""`Training`: a training of one algorithm, part by part; `TrainingLoop`: what is done between two parts."""

import json
import logging
import random
import sys
import time
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import asdict, dataclass, field, replace
from typing import Any

import numpy as np
import torch
from stable_baselines3.common.logger import Logger, configure
from tqdm import tqdm

from flexarm_agents.environments import make_one
from flexarm_agents.evaluation.races import FINISHED, evaluate
from flexarm_agents.evaluation.scoring import rank
from flexarm_agents.files import put
from flexarm_agents.jobs.stopping import StopSignals, TrainingStopped
from flexarm_agents.policies.load import load_policy
from flexarm_agents.policies.network import NetworkPolicy
from flexarm_agents.training.config import RunConfig
from flexarm_agents.training.pictures import draw_curve, draw_laps
from flexarm_agents.training.run_folder import RunFolder, read_checkpoint, write_checkpoint
from flexarm_env.laps import LAPS
from flexarm_env.rollout import run_policy

_log = logging.getLogger(__name__)
EVALUATION_SEED = 1_000_003  # not one of the training's, for any small seed
WORST = (2**31, 0.0)  # a rank that every evaluation beats


@dataclass(kw_only=True)
class TrainingProgress:
    """What a training found so far, and when the next evaluation and checkpoint are due."""

    rows: list[dict[str, Any]] = field(default_factory=list)  # rows of the evaluations
    best: int | None = None  # index of the best row, None before the first
    best_rank: tuple[int, float] = WORST  # rank of that row, see `scoring.rank`
    # Wall time of the training, compiling and evaluations included, in this process and those before [s]
    seconds: float = 0.0
    next_evaluation: int | None = None  # steps at which it is due; None before the first
    next_checkpoint: int | None = None  # steps at which it is due; None before the first

    @property
    def state(self) -> str:
        """The best evaluation in a few words."""
        if self.best is None or self.best_rank[0]:
            return "none with complete laps yet"
        return f"best {self.best_rank[1]:.3f} {'s' if self.rows[self.best]['plain']['ended'] == FINISHED else 'm'}"


class Training(ABC):
    """A training of one algorithm. It consists of parts (rollouts, or rounds), between which it can be resumed."""

    config: Any  # of the algorithm's own class
    logger: Logger

    def __init__(self, config: RunConfig, run: RunFolder) -> None:
        """Check that the training is possible; nothing is written."""
        self.config, self.run, self.progress = config, run, TrainingProgress()

    @property
    @abstractmethod
    def steps(self) -> int:
        """Environment steps so far."""

    @property
    @abstractmethod
    def total(self) -> int:
        """Environment steps of the whole training."""

    @property
    def evaluate_every(self) -> int:
        """Environment steps between two evaluations."""
        return int(self.config.evaluate_every)

    @property
    def checkpoint_every(self) -> int:
        """Environment steps between two checkpoints."""
        return int(self.config.checkpoint_every)

    @abstractmethod
    def start(self) -> None:
        """Make environments and untrained networks."""

    @abstractmethod
    def learn(self, pause: Callable[[], None]) -> None:
        """Train to the end, and call `pause` before each part."""

    @abstractmethod
    def policy(self) -> NetworkPolicy:
        """Return the present policy."""

    @abstractmethod
    def state(self, complete: bool) -> dict[str, Any]:
        """Return what a checkpoint keeps, by name; of a complete training nothing that is only for learning."""

    @abstractmethod
    def restore(self, state: dict[str, Any]) -> None:
        """Make environments and networks as they were, of what `state` returned."""

    @abstractmethod
    def close(self) -> None:
        """Close the environments, if they were made."""

    def keep_best(self) -> None:  # noqa: B027
        """Keep more of the best policy than its numbers, where the algorithm has more."""

    def save(self, complete: bool) -> None:
        """Write a checkpoint between two parts."""
        generators = (random.getstate(), np.random.get_state(), torch.get_rng_state())  # noqa: NPY002  (SB3 uses it)
        kept = {"progress": asdict(self.progress), "random": generators, "state": self.state(complete)}
        write_checkpoint(self.run.checkpoint, self.config, kept)

    def load(self) -> None:
        """Continue from the checkpoint, with the global random generators of then; reading it can execute code."""
        kept = read_checkpoint(self.run.checkpoint, self.config)
        self.progress = TrainingProgress(**kept["progress"])
        self.restore(kept["state"])
        python, numpy, torch_state = kept["random"]
        random.setstate(python)
        np.random.set_state(numpy)  # noqa: NPY002
        torch.set_rng_state(torch_state)


class Rounds(Training):
    """A training in rounds, each of which ends with an evaluation and a checkpoint.

    Attributes:
        done: number of rounds so far.
        round_steps: environment steps of a round.
    """

    done: int
    round_steps: int

    @abstractmethod
    def next_round(self) -> None:
        """Run the next round, record its figures, and count it."""

    @property
    def steps(self) -> int:
        """See `Training`."""
        return self.done * self.round_steps

    @property
    def total(self) -> int:
        """See `Training`."""
        return int(self.config.all_rounds * self.round_steps)

    @property
    def evaluate_every(self) -> int:
        """See `Training`."""
        return self.round_steps

    checkpoint_every = evaluate_every

    def learn(self, pause: Callable[[], None]) -> None:
        """See `Training`."""
        while self.steps < self.total:
            pause()
            self.next_round()


class TrainingLoop:
    """Evaluation laps, the best policy, checkpoints, progress and signals between the parts of a training."""

    def __init__(self, training: Training, stop: StopSignals, progress: bool) -> None:
        """Prepare, for a training that was made or loaded; without a bar, each evaluation is logged in a line."""
        self._training, self._stop = training, stop
        training.logger = configure(str(training.run.logs), ["tensorboard"])
        self._env = make_one(training.config.environment, training.config.options)
        self._races = self._env.unwrapped.settings.mode.races  # type: ignore[attr-defined]
        self._laps = {"plain": "race"} if self._races else {lap: f"{lap} lap" for lap in LAPS}
        self._versions = json.loads(training.run.versions.read_text(encoding="utf-8"))
        self._began, self._before = time.perf_counter(), training.progress.seconds
        with_bar = progress and sys.stderr.isatty()
        steps = {"initial": training.steps, "total": training.total, "unit": " steps", "unit_scale": True}
        self._bar = tqdm(**steps) if with_bar else None

    def run(self) -> None:
        """Train to the end, or to a signal (`TrainingStopped`)."""
        training = self._training
        if training.steps < training.total:
            training.learn(self._pause)
            self._attend(last=True)
        if not training.run.laps.exists():
            best = load_policy(training.run.path).policy
            own = {title: None if self._races else lap for lap, title in self._laps.items()}
            runs = {title: run_policy(self._env, best, EVALUATION_SEED, lap=lap) for title, lap in own.items()}
            draw_laps(runs, training.run.laps)

    def close(self) -> None:
        """Close files, environments and the bar."""
        if self._bar is not None:
            self._bar.close()
        self._env.close()
        self._training.logger.close()

    def _pause(self) -> None:
        training, signal = self._training, self._stop.received
        self._attend(last=False)
        if signal is not None:
            if training.steps > 0:  # before, there is nothing to keep
                training.save(complete=False)
            raise TrainingStopped(signal, training.steps)

    def _attend(self, last: bool) -> None:
        training, found = self._training, self._training.progress
        found.seconds = self._before + time.perf_counter() - self._began
        if self._bar is not None:
            self._bar.update(training.steps - self._bar.n)
        if last or training.steps >= (found.next_evaluation or training.evaluate_every):
            self._evaluate()
            found.next_evaluation = _after(training.steps, training.evaluate_every)
        if last:
            put(training.run.last, self._noted(training.policy()).save)
        if last or training.steps >= (found.next_checkpoint or training.checkpoint_every):
            found.next_checkpoint = _after(training.steps, training.checkpoint_every)
            training.save(complete=last)

    def _evaluate(self) -> None:
        """Score the policy, log and show the figures, and keep it if it is the best so far."""
        training, found, config = self._training, self._training.progress, self._training.config
        policy = training.policy()
        scores = [evaluate(self._env, policy, EVALUATION_SEED + n) for n in range(config.evaluation_laps)]
        worst = type(scores[0])(*(max(laps, key=lambda lap: lap.rank) for laps in zip(*scores, strict=True)))
        row = {"steps": training.steps, "seconds": round(found.seconds, 2), **worst.as_mapping()}
        found.rows.append(row)
        for lap, figures in worst.as_mapping().items():
            for name in ("rms", "maximum", "rms_after_2s", "duration"):
                if figures[name] is not None:
                    training.logger.record(f"evaluation/{lap}/{name}", figures[name])
        training.logger.dump(training.steps)
        training.run.write_evaluations(found.rows)
        draw_curve(found.rows, self._laps, training.run.curve)
        if (of_these := rank(scores)) < found.best_rank:
            found.best, found.best_rank = len(found.rows) - 1, of_these
            put(training.run.best, self._noted(policy).save)
            training.keep_best()
        if self._bar is not None:
            self._bar.set_postfix_str(found.state)
        else:
            _log.info("%9d steps  %6.0f s  %s; %s", training.steps, found.seconds, worst, found.state)

    def _noted(self, policy: NetworkPolicy) -> NetworkPolicy:
        """Return the policy that was scored last, with notes of what it was trained on and of its scores."""
        notes = {
            "config": self._training.config.plain(),
            "evaluation": self._training.progress.rows[-1],
            "versions": self._versions,
        }
        return replace(policy, notes=notes)


def _after(steps: int, every: int) -> int:
    return (steps // every + 1) * every

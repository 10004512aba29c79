"""Measure `FlexArm/SquareChain-v0` for its page: the chain's step, its segments, and scores beside the modelled arm's.

    python -m scripts.docs.chain_figures        # writes docs/environments/square_chain.json, in some minutes

`scripts.docs.environments` makes the page's tables from that file.
"""

from __future__ import annotations

import time
from typing import Any

import gymnasium
import numpy as np
from numpy.typing import NDArray

from flexarm_agents import load_policy, score
from flexarm_agents.board.terms import interface_of
from flexarm_baselines import IFDC
from flexarm_env.envs.documentation import table
from flexarm_env.envs.registration import IDS, NAMESPACE
from flexarm_env.laps import LAPS
from flexarm_env.rollout import run_policy
from scripts.common.command_line import run
from scripts.common.markdown import DOCS
from scripts.common.result_files import write_json

FILE = DOCS / "environments" / "square_chain.json"
CHAIN = "SquareChain-v0"
STEPS = (5e-4, 2.5e-4, 1e-4, 5e-5)  # of MuJoCo [s], the last one the reference
SEGMENTS = (5, 10, 20, 40)  # the last one the reference
GAIN = IDS["SquareGain-v0"].options
# Shipped agents by what the page calls them. The first one's lap shows how the chain converges: what an agent does with
# gauges that read the chain's fast vibrations depends on every detail of the chain.
AGENTS = {"student of random arms": "student_unknown", "PPO": "square"}
CONTROLLERS = (*AGENTS, "IFDC")


def lap(name: str, controller: str, which: str, **options: Any) -> tuple[dict[str, Any], NDArray[np.float64]]:
    """Return the scores of a standard lap, with control periods per second of processor time; and the tip."""
    agent = load_policy(AGENTS[controller]) if controller in AGENTS else None
    own = GAIN if agent is None else interface_of(gymnasium.spec(agent.environment).kwargs | agent.options)
    env = gymnasium.make(f"flexarm_env:{NAMESPACE}/{name}", **(own | options))
    policy = IFDC.for_env(env) if agent is None else agent.policy
    run_policy(env, policy, lap=which, max_steps=2)  # loads or compiles the kernels
    start = time.process_time()
    run = run_policy(env, policy, lap=which)
    rate = (len(run.tip) - 1) / (time.process_time() - start)
    kept = score(run).as_mapping()
    return {name: kept[name] for name in ("ended", "rms", "rms_after_2s")} | {"rate": rate}, run.tip


def measured() -> dict[str, Any]:
    """Run all laps."""
    found: dict[str, Any] = {"steps": [], "segments": [], "scores": []}
    agent, which = CONTROLLERS[0], "swing"
    for kind, option, values in (("steps", "chain_step", STEPS), ("segments", "segments", SEGMENTS)):
        laps = [(value, *lap(CHAIN, agent, which, **{option: value})) for value in values]
        for value, scores, tip in laps:
            found[kind].append({"value": value, "away": _away(tip, laps[-1][2]), **scores})
            print(kind, value, found[kind][-1]["away"], flush=True)
    for which in LAPS:
        for controller in CONTROLLERS:
            on_chain, tip = lap(CHAIN, controller, which)
            found["scores"].append({"arm": "the chain", "controller": controller, "lap": which, **on_chain})
            scores, other = lap("Square-v0", controller, which)
            own = {"arm": "the default arm", "controller": controller, "lap": which, "away": _away(other, tip)}
            found["scores"].append(own | scores)
            print(which, controller, flush=True)
    return found


def _away(tip: NDArray[np.float64], other: NDArray[np.float64]) -> dict[str, float]:
    """Return how far two tips are apart, as long as both go [m]."""
    count = min(len(tip), len(other))
    distance = np.linalg.norm(tip[:count] - other[:count], axis=1)
    return {"rms": float(np.sqrt(np.mean(distance**2))), "maximum": float(distance.max())}


# --- tables for the page ---------------------------------------------------------------------------------------------


def convergence_table(found: dict[str, Any], kind: str) -> str:
    """Return the table of the steps or of the segments."""
    title = {"steps": "longest step of MuJoCo", "segments": "segments a link"}[kind]
    rows = [
        (
            f"{1e3 * row['value']:g} ms" if kind == "steps" else str(row["value"]),
            _millimetres(row["away"]["rms"]),
            _millimetres(row["away"]["maximum"]),
            _score(row),
            f"{row['rate']:.0f}",
        )
        for row in found[kind]
    ]
    apart = ("tip from the last row's, r.m.s. [mm]", "largest [mm]")
    return table((title, *apart, "lap [mm]: r.m.s. / after 2 s", "steps per second"), rows)


def score_table(found: dict[str, Any]) -> str:
    """Return the table of controllers on the chain and on the modelled arm."""
    rows = []
    for chain, model in zip(found["scores"][::2], found["scores"][1::2], strict=True):
        apart = f"{_millimetres(model['away']['rms'])} / {_millimetres(model['away']['maximum'])}"
        rows.append((chain["controller"], chain["lap"], _score(chain), _score(model), apart))
    errors = "on {} [mm]: r.m.s. / after 2 s".format
    head = ("controller", "lap", errors("the chain"), errors("the default arm"), "tips apart [mm]: r.m.s. / largest")
    return table(head, rows)


def _score(row: dict[str, Any]) -> str:
    if row["rms"] is None:
        return f"ended: {row['ended']}"
    return f"{1e3 * row['rms']:.1f} / {1e3 * row['rms_after_2s']:.1f}"


def _millimetres(length: float) -> str:
    return f"{1e3 * length:.0f}" if length >= 0.01 else f"{1e3 * length:.2g}"


def main() -> None:
    """Measure, and write the file."""
    write_json(FILE, measured())
    print(f"{FILE}: written; run python -m scripts.docs.environments")


if __name__ == "__main__":
    run(main)

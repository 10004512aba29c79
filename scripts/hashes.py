"""Hashes of what environments, models, the paper's runs, policies and trainings compute: a change must move no bit.

`python -m scripts.hashes` computes them anew and compares them with scripts/hashes.json; it names what differs and ends
with status 1. `--write` replaces the recorded ones, after a change that must move figures. The hashes hold on the
processors with the instructions of the machine that recorded them (AVX-512 here; numpy's and torch's sums differ
elsewhere): on another machine, record them before a change with `--file`, and compare after it.
"""

import hashlib
import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, Literal

import gymnasium
import numpy as np
from tqdm import tqdm

from flexarm_agents import evaluate, load_policy, shipped_policies
from flexarm_env import ArmParameters, FlexibleArm
from flexarm_env.actions import MODES
from flexarm_env.envs.registration import IDS, NAMESPACE
from scripts.common.command_line import read_options, run
from scripts.common.result_files import write_json

STEPS = 300
SEED = 20_261_124
DRAWN_SETS = 50
FILE = Path(__file__).with_suffix(".json")
Runs = Iterator[tuple[str, Callable[[], str]]]  # names, and what computes the hash
Part = Literal["ids", "modes", "options", "models", "paper", "policies", "training"]
SHORT = ("--steps", "6144", "--envs", "8", "--hidden", "16", "--checkpoint-every", "2048")  # of a training
BATCHES = {"ppo": 64, "recurrent_ppo": 64, "sac": 32, "tqc": 32}  # by the algorithm
CLOCKED = tuple(name for name, mode in MODES.items() if not mode.races)
# Values of options; a set draws five of the options and one value of each.
OPTIONS: dict[str, tuple[Any, ...]] = {
    "action_mode": CLOCKED,
    "arm": ("linear", {"payload_mass": 1.0}, {"preset": "default", "damping_ratio": 0.002}, {"modes_per_link": 2}),
    "control_period": (0.005, 0.02),
    "sensor": ("rigid", "true"),
    "sensor_position": (1.5, 3.0),
    "delay": (0.0, 0.0173, 0.12),
    "noise": (0.01,),
    "jitter": (0.02,),
    "sensor_period": (0.033,),
    "dropout": (0.3,),
    "encoder_noise": ((1e-3, 1e-2),),
    "second_sensor_link": (1, 2),
    "actuation_delay": (0.004, 0.02),
    "observation": (("state", "lap_phase", "torque"), ("joint_angles", "joint_rates", "sensed_position", "previews")),
    "frame": ("world", "link"),
    "previews": ((0.1, 0.5),),
    "last_actions": (3,),
    "scaled": (False,),
    "reference": ("circle", "line", "figure_eight", "moves", ("square", "circle")),
    "side": (11.0,),
    "lap_time": (12.0, 20.0),
    "start_corner": ("upper right",),
    "direction": ("counterclockwise", "either"),
    "elbow_branch": ("positive", "negative"),
    "start": ("corner", "corners", "moving"),
    "randomisation": (
        {"stiffness": (0.8, 1.2), "delay": (0.0, 0.05)},
        {"payload_mass": (0.0, 1.0), "noise": (0.0, 0.01)},
    ),
    "reward_weights": ({"tracking_fine": 1.0, "vibration": 0.5, "effort": 0.1},),
    "torque_limit": ((80.0, 30.0),),
    "deflection_limit": (None, 0.8),
    "error_limit": (None, 1.0),
}


def digest(update: Any, value: Any) -> None:
    """Feed mappings (in the order of their keys), sequences, arrays with types and shapes, and others to a hash."""
    if isinstance(value, Mapping):
        for name in sorted(value):
            update(f"{name}:".encode())
            digest(update, value[name])
    elif isinstance(value, list | tuple) or (isinstance(value, np.ndarray) and value.dtype == object):
        update(f"[{len(value)}".encode())
        for one in value:
            digest(update, one)
    elif isinstance(value, np.ndarray | np.generic):
        array = np.ascontiguousarray(value)
        update(f"{array.dtype}{array.shape}".encode() + array.tobytes())
    else:
        update(repr(value).encode())


def hashed(*values: Any) -> str:
    """Return the hash of values as text."""
    state = hashlib.sha256()
    digest(state.update, values)
    return state.hexdigest()[:20]


def episode(environment: str, num_envs: int, options: Mapping[str, Any]) -> str:
    """Hash observations, rewards, ends and infos of random actions in a batch; `num_envs` = 0: in one environment."""
    name, kind = f"{NAMESPACE}/{environment}", {"num_envs": num_envs} if num_envs else {"disable_env_checker": True}
    make: Any = gymnasium.make_vec if num_envs else gymnasium.make
    env = make(name, **kind, **options)
    space = env.single_action_space if num_envs else env.action_space
    rng = np.random.default_rng(SEED)
    state = hashlib.sha256()
    digest(state.update, env.reset(seed=SEED))
    action = np.zeros((num_envs, *space.shape) if num_envs else space.shape)
    for _ in range(STEPS):
        # Actions wander: white noise would hardly move the arm.
        action = np.clip(action + rng.normal(0.0, 0.2, action.shape), -1.0, 1.0)
        result = env.step(action.astype(space.dtype))
        digest(state.update, result)
        if not num_envs and (result[2] or result[3]):
            digest(state.update, env.reset())
    env.close()
    return state.hexdigest()[:20]


def drawn_sets() -> Iterator[dict[str, Any]]:
    """Draw sets of options that are allowed together."""
    rng = np.random.default_rng(SEED)
    count = 0
    while count < DRAWN_SETS:
        names = sorted(rng.choice(list(OPTIONS), 5, replace=False))
        options = {str(name): OPTIONS[name][rng.integers(len(OPTIONS[name]))] for name in names}
        try:
            gymnasium.make(f"{NAMESPACE}/Square-v0", disable_env_checker=True, **options).close()
        except ValueError:
            continue
        count += 1
        yield options


def ids() -> Runs:
    """All ids: one environment and, but for the chain, batches of 3 and 64."""
    for name, declared in IDS.items():
        for num_envs in (0, 3, 64) if declared.batch_entry else (0,):
            yield f"{name} {num_envs}", partial(episode, name, num_envs, {})


def modes() -> Runs:
    """All action modes, alone and in a batch."""
    for mode in CLOCKED:
        for num_envs in (0, 3):
            yield f"{mode} {num_envs}", partial(episode, "Square-v0", num_envs, {"action_mode": mode})


def options() -> Runs:
    """Drawn sets of options, in turn alone and in a batch. A set's name is its JSON, so that it lasts."""
    for index, drawn in enumerate(drawn_sets()):
        num_envs = 3 * (index % 2)
        yield f"{json.dumps(drawn)} {num_envs}", partial(episode, "Square-v0", num_envs, drawn)


def models() -> Runs:
    """Discrete models of two arms with their derivatives, as plans and filters use them: of one arm, and of a batch."""
    for arm in ("default", "linear"):
        for count in (1, 200):
            yield f"{arm} {count}", partial(model, FlexibleArm(ArmParameters.named(arm)), count)


def model(arm: FlexibleArm, count: int) -> str:
    """Hash steps, their derivatives, outputs and rollouts of an arm with other payloads and stiffnesses."""
    rng = np.random.default_rng(SEED)
    torque = 40.0 * rng.normal(size=(count, 20, 2))
    quantities: dict[str, Any] = {
        "payload_mass": rng.uniform(0.0, 1.0, count),
        "stiffness": rng.uniform(0.8, 1.2, count),
    }
    state = 0.1 * rng.normal(size=(count, 2 * arm.size))
    found: list[Any] = [arm.rollout(state, torque, **quantities), arm.output_jacobians(state)]
    for period in (0.01, 0.004):
        given = state, torque[:, 0]
        found += [arm.step(*given, period, **quantities), arm.step_jacobians(*given, period, **quantities)]
        found += [arm.step_gradients(*given, np.ones_like(state), period, **quantities)]
    return hashed(*found)


def paper() -> Runs:
    """All data files of the paper's twelve runs, without sweeps and pictures."""
    yield "files", paper_files


def paper_files() -> str:
    """Run the paper's cases and hash the files that they leave."""
    with tempfile.TemporaryDirectory() as folder:
        target = Path(folder) / "paper"
        command = ["-m", "scripts.paper", "--output", str(target), "--no-figures", "--no-sweeps", "--workers", "1"]
        subprocess.run([sys.executable, *command], check=True, capture_output=True)
        found = sorted(path for path in target.rglob("*") if path.is_file())
        return hashed({str(path.relative_to(target)): content(path) for path in found})


def content(path: Path) -> Any:
    """Return a file's arrays, or its bytes, without the lines of JSON that tell clock times or follow them."""
    if path.suffix == ".npz":
        with np.load(path, allow_pickle=False) as arrays:
            return dict(arrays)
    return untimed(json.loads(path.read_text())) if path.suffix == ".json" else path.read_bytes()


def untimed(value: Any) -> Any:
    """Return JSON without entries that have "clock" in their names."""
    if isinstance(value, dict):
        return {key: untimed(entry) for key, entry in value.items() if "clock" not in key}
    if isinstance(value, list):
        named = [entry.get("name", "") if isinstance(entry, dict) else "" for entry in value]
        return [untimed(entry) for entry, name in zip(value, named, strict=True) if "clock" not in name]
    return value


def policies() -> Runs:
    """Both laps of each shipped policy, all figures in all digits."""
    for name in shipped_policies():
        yield name, partial(laps, name)


def laps(name: str) -> str:
    """Hash the figures of a shipped policy on both laps."""
    trained = load_policy(name)
    with trained.make_env() as env:
        figures = evaluate(env, trained.policy).as_mapping()
    return hashed(figures)


def training() -> Runs:
    """Last policies of short trainings that were stopped by a signal and resumed."""
    for algorithm, batch in BATCHES.items():
        yield algorithm, partial(resumed, algorithm, batch)


def resumed(algorithm: str, batch: int) -> str:
    """Train, stop at the first checkpoint, resume to the end; hash the last policy's arrays."""
    with tempfile.TemporaryDirectory() as work:
        folder = Path(work) / "run"
        command = [sys.executable, "-c", "from flexarm_agents.commands import main; main()"]
        command += ["train", "--algorithm", algorithm, *SHORT, "--batch", str(batch)]
        command += ["--folder", str(folder), "--seed", "5"]
        with subprocess.Popen(command, stdout=subprocess.DEVNULL) as first:
            while first.poll() is None and not (folder / "checkpoint.zip").exists():
                time.sleep(0.05)
            first.terminate()
        subprocess.run([*command, "--resume"], check=True, stdout=subprocess.DEVNULL)
        arrays = content(folder / "last_policy.npz")
        return hashed({name: array for name, array in arrays.items() if array.dtype.kind == "f"})


@dataclass
class Options:
    """Compare hashes of results with the recorded ones."""

    parts: tuple[Part, ...] = ("ids", "modes", "options", "models", "paper", "policies", "training")
    """What is computed."""
    write: bool = False
    """Record the hashes instead of comparing them."""
    file: Path = FILE
    """Where they are recorded."""


def main() -> None:
    """Compare or record."""
    chosen = read_options("python -m scripts.hashes", Options())
    recorded = json.loads(chosen.file.read_text()) if chosen.file.exists() else {}
    different = []
    for part in chosen.parts:
        former = recorded.get(part, {})
        new = {name: compute() for name, compute in tqdm(list(globals()[part]()), desc=part, unit="run")}
        different += [f"{part}: {name}" for name in {**former, **new} if former.get(name) != new.get(name)]
        if chosen.write:
            write_json(chosen.file, recorded := recorded | {part: new})
    if different and not chosen.write:
        raise SystemExit("hashes differ:\n" + "\n".join(different))


if __name__ == "__main__":
    run(main)

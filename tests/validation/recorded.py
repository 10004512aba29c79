"""Trajectories of both engines, kept as data: what they found is compared on machines that have neither.

python -m tests.validation.recorded        # runs MuJoCo and Exudyn anew and writes the file
"""

from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from tests.validation.motion import PROGRAMMES, Motion, Programme, extrapolated

FILE = Path(__file__).parent / "engines.npz"
EVERY = 10  # `HELD` between two records
ENGINES = ("mujoco", "exudyn")
SEGMENTED = (10, 20)  # elements of the chains that the record is extrapolated from
DOUBLED = ("multi_sine", "spin_up")  # smooth programmes, kept at twice the amplitude too
LEFT_OUT = ("release", "bang_bang")  # the first begins with bent links, the second shows what the doublet shows


def cases() -> dict[str, Programme]:
    """Return what is recorded, by name: programmes at amplitude 1, smooth ones at 2 as well."""
    found = {programme.name: programme for programme in PROGRAMMES if programme.name not in LEFT_OUT}
    return found | {f"{name}, twice": found[name].times(2.0) for name in DOUBLED}


def thinned(motion: Motion) -> Motion:
    """Return a motion as it is recorded: every `EVERY` times `HELD`."""
    return Motion(*(part[::EVERY] for part in motion))


def load() -> dict[str, dict[str, Motion]]:
    """Return the recorded motions of each engine, by the names of `cases`."""
    with np.load(FILE) as data:
        return {
            engine: {
                name: Motion(*(data[f"{engine}: {name}: {part}"].astype(float) for part in Motion._fields))
                for name in cases()
            }
            for engine in ENGINES
        }


def main() -> None:
    from tests.validation.arms import chain_motion
    from tests.validation.cables import cable_motion

    kept: dict[str, Any] = {engine: np.array(version(engine)) for engine in ENGINES}
    for name, programme in cases().items():
        chains = extrapolated(*(chain_motion(programme, n) for n in SEGMENTED))
        for engine, motion in (("mujoco", chains), ("exudyn", cable_motion(programme))):
            # micrometres and less are kept: a float32 of 9 m has steps of 1e-6 m
            parts = thinned(motion)._asdict().items()
            kept |= {f"{engine}: {name}: {part}": values.astype(np.float32) for part, values in parts}
    np.savez_compressed(FILE, **kept)


if __name__ == "__main__":
    main()

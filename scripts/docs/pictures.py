"""Draw the pictures that introduce the benchmark, from the laps and figures that are kept in docs/."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from flexarm_env.validation import choice
from scripts.common.command_line import read_options, run
from scripts.common.markdown import DOCS
from scripts.docs import arm_pictures, lap_pictures, motion_pictures, overview_pictures

PICTURES: dict[str, Callable[[Path], None]] = {
    "first_second.webp": arm_pictures.moving,
    "first_second.png": arm_pictures.still,
    "terms.png": arm_pictures.terms,
    "late_sensor.png": motion_pictures.late_sensor,
    "corner.png": motion_pictures.corner,
    "wrong_way.png": motion_pictures.wrong_way,
    "best_plan.png": motion_pictures.best_plan,
    "race.webp": motion_pictures.race,
    "payload.png": overview_pictures.payload,
    "error_over_loss.png": overview_pictures.error_over_loss,
    "distance_from_chain.png": overview_pictures.distance_from_chain,
    "leaderboard/errors.png": lap_pictures.errors,
    "leaderboard/corners.png": lap_pictures.corners,
    "leaderboard/effort.png": lap_pictures.effort,
}


@dataclass
class Options:
    """Draw the pictures that introduce the benchmark."""

    output: Path = DOCS / "figures"
    """Folder for the files; existing ones are replaced."""
    only: tuple[str, ...] = tuple(PICTURES)
    """Names of the files to draw."""


def main() -> None:
    """Command line."""
    options = read_options("python -m scripts.docs.pictures", Options())
    chosen = {name: PICTURES[choice("only", name, PICTURES)] for name in options.only}
    options.output.mkdir(parents=True, exist_ok=True)
    for name, draw in chosen.items():
        draw(options.output / name)
        print(f"{options.output / name}: drawn", flush=True)


if __name__ == "__main__":
    run(main)

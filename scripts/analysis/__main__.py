"""Linear control theory of the arm: zeros against the sensor's position, passivity, margins of the paper's loop."""

from functools import partial
from itertools import product

from scripts.analysis import figures, margins, passivity, simulated, tables, zeros
from scripts.common.command_line import run
from scripts.common.study import Study, Trial, Trials, command


def _margins() -> dict[str, Trial]:
    """Return the linear theory, and each case that is simulated: two sensors, late in two ways, three gains."""
    cases = product(list(margins.SENSORS)[:2], margins.DELAYED, margins.GAINS)
    return {"linear": margins.study, **{", ".join(case): partial(simulated.delays, *case) for case in cases}}


STUDIES = {
    "zeros": Study(
        "zeros from the torques to a point of link 2",
        Trials(zeros.__name__, lambda: {"zeros": zeros.study}),
        {"zeros_by_model": tables.zeros_by_model},
        {"zeros_locus": figures.zeros_locus, "bode": figures.bode},
        svg=True,
    ),
    "passivity": Study(
        "which paths from torque to rate are positive real",
        Trials(passivity.__name__, lambda: {"passivity": passivity.study}),
        {"passivity": tables.passivity},
        {"passivity": figures.passivity},
        svg=True,
    ),
    "margins": Study(
        "margins of the paper's loop",
        Trials(simulated.__name__, _margins),
        {
            "largest_gains": tables.largest_gains,
            "margins_claim": tables.margins_claim,
            "margins_by_modes": tables.margins_by_modes,
            "simulated": tables.simulated,
        },
        {"margins": figures.margins},
        svg=True,
    ),
}


def main() -> None:
    """Command line."""
    command("analysis", STUDIES, "Find poles, zeros, passivity and margins of the arm, with figures and JSON.")


if __name__ == "__main__":
    run(main)

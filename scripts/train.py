"""Train an agent by reward: `flexarm train`, from a clone; or many, with `--seeds` and `--sweep` (`scripts.sweep`)."""

import sys

from flexarm_agents.commands import main
from flexarm_agents.commands.ending import run

MANY = ("--seeds", "--sweep")


def many() -> None:
    """Train every setting with every seed.

    Raises:
        ImportError: if the file was run by its path, which does not find the other studies.
    """
    try:
        from scripts.sweep import main as sweep
    except ModuleNotFoundError as error:
        raise ImportError(f"{' and '.join(MANY)} need: python -m scripts.train ({error})") from error
    sweep()


if __name__ == "__main__":
    if any(one.partition("=")[0] in MANY for one in sys.argv[1:]):
        run(many)
    else:
        main(["train", *sys.argv[1:]])

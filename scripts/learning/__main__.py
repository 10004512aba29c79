"""Tables and pictures of the studies of learning, from the committed data.

The trainings are finished: each agent's `config` in docs/figures/agents/STUDY.json has what `flexarm train` was
given.
"""

from scripts.common.command_line import run
from scripts.common.study import Study, command
from scripts.learning import any_path, conditions, teaching

STUDIES: dict[str, Study] = {**conditions.STUDIES, **teaching.STUDIES, "any_path": any_path.STUDY}
TEXT = "Show what studies of learning found, from the data of finished trainings."


def main() -> None:
    """Command line."""
    command("learning", STUDIES, TEXT)


if __name__ == "__main__":
    run(main)

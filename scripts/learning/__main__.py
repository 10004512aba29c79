"""Tables and pictures of what learning gives beside classical laws and limits, from the committed data.

The trainings are finished: each agent's `config` in docs/figures/agents/STUDY.json has what `flexarm train` was
given.
"""

from scripts.common.command_line import run
from scripts.common.study import Study, command
from scripts.learning import delays, exploration, gradients, laws, off_policy, spillover

STUDIES: dict[str, Study] = {
    "schedulers": laws.SCHEDULERS,
    "modes": laws.MODES,
    "delays": delays.STUDY,
    "exploration": exploration.STUDY,
    "gradients": gradients.STUDY,
    "off_policy": off_policy.STUDY,
    "spillover": spillover.STUDY,
}


TEXT = "Show what learning gives, from the data of finished trainings."


def main() -> None:
    """Command line."""
    command("learning", STUDIES, TEXT)


if __name__ == "__main__":
    run(main)

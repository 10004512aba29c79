"""`flexarm warm-up`: compile ahead of time."""

from collections.abc import Sequence

from flexarm_agents.commands.arguments import Reader, add_options, of_verb
from flexarm_agents.environments import check_id
from flexarm_env.envs.registration import IDS, NAMESPACE
from flexarm_env.envs.warm_up import warm_up

DESCRIPTION = """\
Compile the kernels that environments need and keep them in the cache folder (FLEXARM_CACHE_DIR overrides where
that is), so that no first step waits: for container images, and before many processes start at once."""


def parser() -> Reader:
    """Return the parser of the arguments."""
    reader = of_verb("warm-up", DESCRIPTION)
    everything = [f"{NAMESPACE}/{name}" for name, one in IDS.items() if not one.extra]
    reader.add_argument(
        "ids", nargs="*", default=everything, metavar="ID", help="environments; without any, all that need no extra"
    )
    add_options(reader, "options that the environments will be made with")
    reader.add_argument("--num-envs", type=int, nargs="+", default=[1], metavar="N", help="numbers of environments; 1")
    return reader


def run(arguments: Sequence[str]) -> None:
    """Compile, and print a line for each kernel."""
    given = parser().parse_args(arguments)
    for environment in [check_id(one) for one in given.ids]:
        for line in warm_up([environment], given.options, given.num_envs):
            print(line, flush=True)

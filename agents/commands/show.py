"""`flexarm show`: an environment's specification, from the declarations that its page under docs is made from."""

from collections.abc import Sequence

from flexarm_agents.commands.arguments import Reader, of_verb, width
from flexarm_agents.commands.text import from_markdown
from flexarm_agents.environments import check_id, declared_id
from flexarm_env.envs import documentation as doc
from flexarm_env.envs.settings import Settings
from flexarm_env.extras import install_command


def parser() -> Reader:
    """Return the parser of the arguments."""
    reader = of_verb("show", "Show the specification of an environment.")
    names = 'e.g. "FlexArm/Square-v0", or without the namespace; of another module, "module:Mine/Task-v0"'
    reader.add_argument("id", metavar="ID", help=names)
    return reader


def run(arguments: Sequence[str]) -> None:
    """Print the specification."""
    print(specification(check_id(parser().parse_args(arguments).id), width()))


def specification(environment: str, columns: int) -> str:
    """Write the specification of an id."""
    one = declared_id(environment)
    actions, observations = doc.spaces(Settings.of(one.options))
    name = environment if ":" in environment else f"flexarm_env:{environment}"
    facts = [
        ("actions", actions),
        ("observations", observations),
        ("episode", doc.timing(one)),
        ("make", f'gymnasium.make("{name}")'),
        ("batch", f'gymnasium.make_vec("{name}", num_envs=16)'),
    ] + ([("needs", install_command(one.extra))] if one.extra else [])
    different = {"Different from Square-v0": doc.difference_table(one)} if one.options else {}
    table = doc.table(("environment", environment), facts)
    parts = [from_markdown(f"{environment}: {one.summary}.\n\n{one.text}\n\n{table}", columns)]
    parts += [
        f"{name.upper()}\n\n{from_markdown(text, columns)}" for name, text in (different | doc.sections(one)).items()
    ]
    return "\n\n".join(parts)

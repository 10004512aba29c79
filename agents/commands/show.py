"""`flexarm show`: an environment's specification, from the declarations that its page under docs is made from."""

from __future__ import annotations

from collections.abc import Sequence

from flexarm_agents.commands.arguments import reader, width
from flexarm_agents.commands.text import from_markdown
from flexarm_agents.environments import check_id
from flexarm_env.envs import documentation as doc
from flexarm_env.envs.observation import observation_layout
from flexarm_env.envs.registration import IDS
from flexarm_env.envs.settings import Settings
from flexarm_env.extras import install_command


def run(arguments: Sequence[str]) -> None:
    """Print the specification."""
    parser = reader("show", "Show the specification of an environment.")
    parser.add_argument("id", metavar="ID", help='e.g. "FlexArm/Square-v0", or without the namespace')
    print(specification(check_id(parser.parse_args(arguments).id), width()))


def specification(environment: str, columns: int) -> str:
    """Write the specification of an id.

    Args:
        environment: its id, checked.
        columns: width of a line.
    """
    one = IDS[environment.partition("/")[2]]
    settings = Settings.of(one.options)
    mode = settings.mode
    count = len(observation_layout(settings, settings.program).scale)
    period = settings.control_period
    facts = [
        ("actions", f"Box(-1, 1, ({len(mode.channels)},), float32)"),
        ("observations", f"Box(({count},), float32)"),
        ("control period", f"{doc.figure(1e3 * period)} ms"),
        ("episode", f"{one.steps} steps, {doc.figure(one.steps * period)} s"),
        ("make", f'gymnasium.make("flexarm_env:{environment}")'),
        ("batch", f'gymnasium.make_vec("flexarm_env:{environment}", num_envs=16)'),
    ] + ([("needs", install_command(one.extra))] if one.extra else [])
    sections = {
        "Action space": f"action_mode is {settings.action_mode}: {mode.text}.\n\n{doc.action_table(settings)}",
        "Observation space": f"{doc.BLOCK_RULES}\n\n{doc.block_table(settings)}",
        "Frames and units": doc.FRAMES,
        "The side of the elbow": doc.BRANCHES,
        "Mirror images": doc.MIRROR,
        "Reward": f"{doc.REWARD}\n\n{doc.reward_table(settings)}",
        "Starting state": f"Here start is {settings.start}.\n\n{doc.start_table()}",
        "Episode end": f"{doc.ENDING}\n\n{doc.end_table(settings)}",
        "Info": f"{doc.info_table(settings)}\n\n{doc.EPISODE}\n\n{doc.episode_table()}",
        "Options": f"Arguments of make and make_vec.\n\n{doc.argument_table(settings, one.options)}",
        **({"Options of its own": doc.own_table(one.options_of)} if one.options_of else {}),
        "Reset options": doc.option_table(),
    }
    table = doc.table(("environment", environment), facts)
    parts = [f"{environment}: {one.summary}", from_markdown(f"{one.text}\n\n{table}", columns)]
    parts += [f"{name.upper()}\n\n{from_markdown(text, columns)}" for name, text in sections.items()]
    return "\n\n".join(parts)

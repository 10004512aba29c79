"""`flexarm list`: the ids, the shipped policies and the controllers."""

from collections.abc import Sequence

from flexarm_agents.commands.arguments import Reader, of_verb
from flexarm_agents.commands.text import columns
from flexarm_agents.policies.load import load_policy, shipped_policies
from flexarm_baselines.registry import CONTROLLERS
from flexarm_env.envs.documentation import figure
from flexarm_env.envs.observation import observation_layout
from flexarm_env.envs.registration import IDS, NAMESPACE
from flexarm_env.envs.settings import Settings


def parser() -> Reader:
    """Return the parser of the arguments."""
    return of_verb("list", "List the environments, policies and controllers that come with the package.")


def run(arguments: Sequence[str]) -> None:
    """Print the lists."""
    parser().parse_args(arguments)
    rows = [("id", "actions", "observations", "period", "task")]
    for name, one in IDS.items():
        settings = Settings.of(one.options)
        actions = len(settings.mode.channels)
        observations = len(observation_layout(settings, settings.program).scale)
        period = f"{figure(1e3 * settings.control_period)} ms"
        rows.append((f"{NAMESPACE}/{name}", str(actions), str(observations), period, one.summary))
    print(columns(rows))
    print(
        f'\ngymnasium.make("flexarm_env:{NAMESPACE}/Square-v0") makes one; `flexarm show ID` has its specification.\n'
    )
    trained = [(name, load_policy(name).environment) for name in shipped_policies()]
    print(columns([("shipped policy", "trained on"), *trained]))
    print()
    print(columns([("controller", "what it is"), *((name, one.text) for name, one in CONTROLLERS.items())]))
    print("\n`flexarm evaluate --policy NAME` scores one. ifdc_late on the leaderboard is `ifdc` with a late sensor.")

"""Train an agent with PPO: `flexarm train`, from a clone."""

import sys

from flexarm_agents.commands import main

if __name__ == "__main__":
    main(["train", *sys.argv[1:]])

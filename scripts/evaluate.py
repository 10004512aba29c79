"""Score controllers and trained policies on the two standard laps: `flexarm evaluate`, from a clone."""

import sys

from flexarm_agents.commands import main

if __name__ == "__main__":
    main(["evaluate", *sys.argv[1:]])

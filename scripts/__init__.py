"""Studies of this repository, run from its root: `python -m scripts.paper` and the like; `make` has a verb for each."""

import sys

from flexarm_agents.commands.ending import end_at_once

if sys.argv[0] == "-m":  # Python's own sign that a study is being started: others only import it
    end_at_once()

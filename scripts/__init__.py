"""Studies of this repository, run from its root: `python -m scripts.paper` and the like; `make` has a verb for each."""

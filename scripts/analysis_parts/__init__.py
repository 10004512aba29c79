"""Parts of `scripts/analyse.py`."""

"""Parts of `scripts/analysis/__main__.py`."""

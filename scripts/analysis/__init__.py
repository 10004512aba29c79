"""The linear theory's figures and tables: `python -m scripts.analysis`."""

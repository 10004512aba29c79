"""The parts of `python -m scripts.paper`: cases -> runs (npz) -> claims, numbers, sweeps -> tables, figures."""

"""The parts of `scripts/paper/__main__.py`: cases -> runs (npz) -> claims, numbers, sweeps -> tables, figures."""

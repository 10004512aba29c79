"""The parts of `scripts/reproduce_paper.py`: cases -> runs (npz) -> claims, numbers, sweeps -> tables, figures."""

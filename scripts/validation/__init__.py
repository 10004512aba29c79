"""What `validate.py` does: checks of the physics against theory, other methods, and an engine of other hands."""

"""The validation (`make validate`): checks of the physics against theory, other methods and an independent engine."""

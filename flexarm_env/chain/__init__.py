"""The arm as a chain of rigid segments in MuJoCo, an independent engine: a model, and the arm of an environment."""

from flexarm_env.extras import needs_extra

with needs_extra("flexarm_env.chain", "chain"):
    import mujoco  # noqa: F401  (its modules import it without further words)

"""The arm as a chain of rigid segments in MuJoCo, an independent engine; it needs the package mujoco."""

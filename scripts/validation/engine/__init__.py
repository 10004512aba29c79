"""The comparison with MuJoCo's chain."""

"""The arm as an object: open loop, closed loop, limits, trajectories and their files."""

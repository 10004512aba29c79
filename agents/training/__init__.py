"""Training by reward: its configuration, its folder, its checkpoints."""

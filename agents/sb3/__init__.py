"""What connects the arms and the policies with stable-baselines3."""

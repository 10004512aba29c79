"""The laws that act inside the integrator: the Jacobian-transpose law of the paper, and joint-space tracking."""

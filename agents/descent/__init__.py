"""First-order policy gradients: a network learns by derivatives that run back through arm, sensor and itself."""

"""The compiled loops of the arm alone and of the paper's loop: layout, integrators, delay line. They have no reward."""

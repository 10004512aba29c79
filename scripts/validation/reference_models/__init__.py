"""Independent models that frequencies are compared with: exact beams and finite elements."""

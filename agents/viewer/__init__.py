"""An arm in a window or in a film."""

"""Hardening: what is tried against the package, how often, and what came of it."""

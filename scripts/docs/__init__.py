"""Bring what is generated under docs/ up to date."""

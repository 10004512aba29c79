"""Policies that numpy alone runs: a network, what encodes its observations, and their files."""

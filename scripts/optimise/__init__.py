"""The best known laps: search over branch sequences, and plans as data."""

"""The benchmark (`make bench`): how time is taken, and what is timed."""

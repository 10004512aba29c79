"""The benchmark (`make bench`): how time is taken, what is timed, and the same lap with scipy."""

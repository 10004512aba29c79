"""The parts of `bench.py`: how time is taken, what is timed, and the same lap with scipy."""

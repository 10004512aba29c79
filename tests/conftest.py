"""Settings of the processes that run the tests, and of those that the tests start."""

import os

# One thread for linear algebra: matrices here have a few hundred rows at most, and threads that wait for each other in
# every process cost far more than they save. Libraries read this when
# numpy is imported, which is after this file.
for variable in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(variable, "1")

"""One thread for matrix products, in the tests' processes and in those that they start.

To be imported before NumPy. The matrices are small: threads that wait for the next one to
multiply take longer than all else, the more so with a process of tests on each core.
"""

from __future__ import annotations

import os

for _name in ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS"):
    os.environ.setdefault(_name, "1")

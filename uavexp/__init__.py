"""Seeded, batch-run experiments on when a UAV should replan in unknown indoor spaces.

Importing the package loads nothing heavy. It pins every thread pool to one thread, before
numpy can start them: matrix products change bits between one thread and two, and a
result must not depend on the machine's core count. It also tells numba which compiled
kernels are stale (`uavexp.kernel_cache`).
"""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Any

from uavexp.kernel_cache import LOCATOR, VARIABLE

if TYPE_CHECKING:
    from uavexp.flight import Trial

__version__ = "0.1.0"

_THREAD_VARIABLES = (
    "OMP_NUM_THREADS",
    "OPENBLAS_NUM_THREADS",
    "MKL_NUM_THREADS",
    "BLIS_NUM_THREADS",
    "NUMEXPR_NUM_THREADS",
    "VECLIB_MAXIMUM_THREADS",
    "TBB_NUM_THREADS",
    "NUMBA_NUM_THREADS",
)
# overridden, not defaulted: a user's OMP_NUM_THREADS=2 would change results
os.environ.update(dict.fromkeys(_THREAD_VARIABLES, "1"))
os.environ[VARIABLE] = LOCATOR


def fly(*overrides: str, **values: Any) -> Trial:
    """Fly one trial and return it (`uavexp.flight.fly`), e.g. `fly(strategy="mcr", seed=0)`."""
    from uavexp import flight

    return flight.fly(*overrides, **values)

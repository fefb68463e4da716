"""Seeded, batch-run experiments on when a UAV should replan in unknown indoor spaces.

    trial = uavexp.fly(strategy="mcr", world="rooms", seed=0)     help(uavexp.fly), help(uavexp.Trial)
    study = uavexp.read_study("outputs/0001-mcr-rooms")            help(uavexp.Study)

Importing the package loads nothing heavy. It pins every thread pool to one thread, before
numpy can start them: matrix products change bits between one thread and two, and a
result must not depend on the machine's core count. It also tells numba which compiled
kernels are stale (`uavexp.kernel_cache`), and lets Ctrl-C end a command that still loads.
"""

from __future__ import annotations

import os
import sys
from importlib import import_module
from typing import TYPE_CHECKING, Any

from uavexp.interrupts import leave_at_once
from uavexp.kernel_cache import LOCATOR, VARIABLE

if TYPE_CHECKING:
    from uavexp.errors import UavexpError
    from uavexp.flight import Trial, fly
    from uavexp.study import Study, read_study

__version__ = "0.1.0"
__all__ = ["Study", "Trial", "UavexpError", "fly", "read_study"]

_FOUND_IN = {  # imported when first asked for
    "Study": "uavexp.study",
    "Trial": "uavexp.flight",
    "UavexpError": "uavexp.errors",
    "fly": "uavexp.flight",
    "read_study": "uavexp.study",
}

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
if sys.argv[:1] == ["-m"]:  # `python -m uavexp...`, while Python still looks for the command
    leave_at_once()
# overridden, not defaulted: a user's OMP_NUM_THREADS=2 would change results
os.environ.update(dict.fromkeys(_THREAD_VARIABLES, "1"))
os.environ[VARIABLE] = LOCATOR


def __getattr__(name: str) -> Any:
    if name not in _FOUND_IN:
        raise AttributeError(f"module 'uavexp' has no attribute '{name}'")
    return getattr(import_module(_FOUND_IN[name]), name)


def __dir__() -> list[str]:
    return [*globals(), *__all__]

"""Memory of large maps: only what is written to is taken."""

from __future__ import annotations

import mmap
from typing import Any

import numpy as np
import numpy.typing as npt

_LARGE = 16_000_000  # entries; smaller arrays are faster in large pages


def blank(size: int, kind: type[np.generic]) -> npt.NDArray[Any]:
    """Zeros (N,) that take memory where they are written to.

    numpy's own come in pages of 2 MB, and of a large map a flight touches something in nearly each.
    """
    if size < _LARGE or not hasattr(mmap, "MADV_NOHUGEPAGE"):  # which Linux alone has
        return np.zeros(size, kind)
    memory = mmap.mmap(-1, size * np.dtype(kind).itemsize, mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS)
    memory.madvise(mmap.MADV_NOHUGEPAGE)
    return np.frombuffer(memory, kind)

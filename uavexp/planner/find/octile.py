"""The length of the shortest 26-connected path in free space."""

from __future__ import annotations

import numba as nb


@nb.njit(cache=True, inline="always")
def octile(di: int, dj: int, dk: int) -> float:
    """Length of the shortest voxel path over (di, dj, dk) in free space, voxels."""
    a, b, c = abs(di), abs(dj), abs(dk)
    least, most = min(a, b, c), max(a, b, c)
    middle = a + b + c - least - most
    return most + 0.41421356237309503 * middle + 0.3178372451957822 * least

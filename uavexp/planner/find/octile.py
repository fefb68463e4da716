"""The length of the shortest 26-connected path in free space."""

from __future__ import annotations

import numba as nb


@nb.njit(cache=True, inline="always")
def octile(
    di: int, dj: int, dk: int, edge: float = 0.41421356237309515, corner: float = 0.31783724519578205
) -> float:
    """Length of the shortest voxel path over (di, dj, dk) in free space, voxels.

    Args:
        di: voxels along x.
        dj: along y.
        dk: along z.
        edge: √2 - 1; by default rounded as the difference of the steps' rounded lengths.
        corner: √3 - √2, likewise.
    """
    a, b, c = abs(di), abs(dj), abs(dk)
    least, most = min(a, b, c), max(a, b, c)
    middle = a + b + c - least - most
    return most + edge * middle + corner * least

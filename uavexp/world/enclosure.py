"""How far cells of air are enclosed by surfaces: rays to eight sides and upwards (numba)."""

from __future__ import annotations

import numba as nb
import numpy as np

from uavexp.arrays import Bool, UInt8

SIDES = 8
_ALL_ROUND, _UNDER_A_CEILING = 6, 3  # sides, of eight, on which an enclosed cell meets a surface


@nb.njit(cache=True)
def sides_met(blocked: Bool) -> UInt8:
    """On how many of eight level sides, 45° apart, each cell (X, Y, Z) has a blocked cell before it."""
    nx, ny, nz = blocked.shape
    sides = np.zeros(blocked.shape, dtype=np.uint8)
    for di in range(-1, 2):
        for dj in range(-1, 2):
            if di == 0 and dj == 0:
                continue
            # swept against the ray: what the next cell meets is known before
            met, ahead = np.zeros((ny, nz), dtype=np.bool_), np.zeros((ny, nz), dtype=np.bool_)
            for a in range(nx):
                i = nx - 1 - a if di > 0 else a
                for b in range(ny):
                    j = ny - 1 - b if dj > 0 else b
                    if not (0 <= i + di < nx and 0 <= j + dj < ny):
                        met[j] = False
                        continue
                    for k in range(nz):
                        beyond = met[j + dj, k] if di == 0 else ahead[j + dj, k]
                        met[j, k] = blocked[i + di, j + dj, k] or beyond
                        sides[i, j, k] += met[j, k]
                if di != 0:
                    met, ahead = ahead, met
    return sides


def enclosed(blocked: Bool) -> Bool:
    """Which cells (X, Y, Z) lie inside a building, whether it has all its walls and a ceiling or not.

    By the votes of rays, after Nooruddin and Turk 2003: surfaces on six of eight level sides, or on
    three under a ceiling. A yard sees the house on three, the corner of an L on five. Where most of
    such cells have a floor, those without one lie between buildings.
    """
    sides = sides_met(blocked)
    above = np.logical_or.accumulate(blocked[..., ::-1], axis=2)[..., ::-1]
    inside: Bool = ((sides >= _ALL_ROUND) | (above & (sides >= _UNDER_A_CEILING))) & ~blocked
    on_floor = inside & np.logical_or.accumulate(blocked, axis=2)
    return on_floor if 2 * np.count_nonzero(on_floor) > np.count_nonzero(inside) else inside

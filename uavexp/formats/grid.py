"""Cells in memory, of no more than a computer can hold."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from uavexp.arrays import Float, Int, UInt8
from uavexp.errors import WorldError
from uavexp.formats.base import FREE, SOLID, UNMEASURED, Cells

MOST_CELLS = 1 << 30  # a byte each: 1 GiB


def filled(path: Path, shape: Float | Int, state: int) -> UInt8:
    """Return cells (X, Y, Z) that all have one state.

    Raises:
        WorldError: they would take more than 1 GiB.
    """
    count = float(np.prod(shape.astype(np.float64)))
    if not 0.0 < count <= MOST_CELLS:
        size = " x ".join(f"{length:.4g}" for length in shape)
        raise WorldError(
            f"world file {path} spans {size} cells, at most {MOST_CELLS:.3g} in all are allowed: "
            "crop it, or write it with larger voxels"
        )
    return np.full(shape.astype(np.int64), state, dtype=np.uint8)


def of_centres(path: Path, solid: Float, free: Float | None, size: float) -> Cells:
    """Return the cells of voxels' centres (N, 3); when no free ones were measured, all others are free."""
    known = solid if free is None else np.concatenate([solid, free])
    corner = known.min(axis=0)
    state = filled(path, np.rint(np.ptp(known, axis=0) / size) + 1, FREE if free is None else UNMEASURED)
    if free is not None:
        state[tuple(np.rint((free - corner) / size).astype(np.int64).T)] = FREE
    state[tuple(np.rint((solid - corner) / size).astype(np.int64).T)] = SOLID
    return Cells(state=state, origin=corner - 0.5 * size, size=np.full(3, size))


def of_blocked(path: Path, shape: Float, blocked: Float) -> Cells:
    """Return cells of edge 1 from the origin; `blocked` (N, 3) ones are solid, the others free.

    Raises:
        WorldError: a blocked cell is no whole number or lies outside.
    """
    if not ((blocked >= 0) & (blocked < shape) & (blocked == np.floor(blocked))).all():
        size = " x ".join(f"{length:g}" for length in shape)
        raise WorldError(f"world file {path} is damaged: a blocked cell lies outside its {size} cells")
    state = filled(path, shape, FREE)
    state[tuple(blocked.astype(np.int64).T)] = SOLID
    return Cells(state=state, origin=np.zeros(3), size=np.ones(3))

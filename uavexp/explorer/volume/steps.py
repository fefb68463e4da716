"""The 26 steps on a grid, what they cost, and which of them need not be tried after another.

Where all passable cells cost the same, most steps from a cell lead where a way that avoids the cell leads for
no more, if the cells beside are free: of all least ways the one that takes long steps first is enough
(Harabor and Grastien 2011, on the plane; Sturtevant and Rabin 2016).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from uavexp.arrays import Float, Int, Int32

UNIT = 100  # a straight step between cells of the least price
MOST_PRICE = 5.0
ANY_STEP = 1 << 26  # the bit of a cell from which all steps are tried
_ALWAYS, _NEVER = -2, -1
_MOVES = np.array([move for move in np.ndindex(3, 3, 3) if move != (1, 1, 1)]) - 1  # (26, 3) cells


class Steps(NamedTuple):
    """The 26 steps on a grid laid flat, and as the 27th none."""

    offset: Int  # (26,)
    behind: Int  # (27,) the same, and 0
    needed: Int  # (27,) how many steps may be needed after another
    after: Int  # (27, 26) these
    instead: Int  # (27, 26) that with which a way begins that makes it needless, if passable; -1: none does


def _lengths(moves: Int) -> Int:
    return np.asarray(np.floor(UNIT * np.linalg.norm(moves, axis=-1) + 0.5).astype(np.int64))


def _spared() -> Int:
    """Matrix (26, 26): after the first step, what spares the second; see `Steps.instead`, and `_ALWAYS`."""
    length, spared = _lengths(_MOVES), np.full((26, 26), _NEVER)
    for first, second in np.ndindex(spared.shape):
        end = _MOVES[first] + _MOVES[second]
        if np.abs(end).max() <= 1:  # one step leads there
            spared[first, second] = _ALWAYS
            continue
        last = end - _MOVES
        possible = np.abs(last).max(axis=1) <= 1
        cost = np.where(possible, length + _lengths(last), np.inf)
        best = int(np.lexsort((-length, cost))[0])
        if cost[best] < cost[first] or length[best] > length[first]:
            spared[first, second] = best
    return spared


def steps_on(shape: tuple[int, int, int]) -> Steps:
    """The steps on a grid of this shape (margin included)."""
    offset = _MOVES @ np.array([shape[1] * shape[2], shape[2], 1])
    spared = np.vstack([_spared(), np.full(26, _NEVER)])
    after = np.argsort(spared == _ALWAYS, axis=1, kind="stable")
    return Steps(
        offset=offset,
        behind=np.append(offset, 0),
        needed=(spared != _ALWAYS).sum(axis=1),
        after=after,
        instead=np.take_along_axis(spared, after, axis=1),
    )


class Prices(NamedTuple):
    """What ways cost by the kinds of their cells; see `prices`."""

    cell: Float  # (K,) of a cell of each kind, 1 and more; 0: not passable
    climb: Float  # (K,) factor on steps up or down to or from it
    toll: Int32  # (K, K, 26) cost of each step from a kind of cell to another
    even: bool  # whether every way costs its length


def prices(cell: Float, climb: Float) -> Prices:
    """What ways cost over cells of each kind (K,); no step costs more than `MOST_PRICE` times its length.

    A step from a kind that is not passable, that of a source, counts as from one of the least price.
    """
    mean = 0.5 * (np.maximum(cell, 1.0)[:, None, None] + cell[None, :, None])
    rise = np.where(_MOVES[:, 2] != 0, np.maximum(climb[:, None], climb)[:, :, None], 1.0)
    toll = np.floor(np.minimum(mean * rise, MOST_PRICE) * _lengths(_MOVES)).astype(np.int32)
    even = np.isin(cell, (0.0, 1.0)).all() and (climb == 1.0).all()
    return Prices(cell, climb, toll, bool(even))

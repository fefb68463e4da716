"""The 26 moves of a voxel path, none of which cuts a corner, and which of them A* needs.

A move is numbered 9 (di + 1) + 3 (dj + 1) + dk + 1; 13 is no move at all, 26 - n the way back.
It is open when every cell of the box it moves through is free, so that a body as large as a
voxel can make it, and so can interpolated clearance: it is nowhere less than in the cells.
A neighbourhood is 27 bits, bit n set when the cell that move n leads to is free.

Canonical moves. A path from p to x need not go on to n when p reaches n without x: by one open
move, or through another cell y of x's neighbourhood by a shorter path, or by one equally
long that y takes over. Of two cells from which n is reached at equal cost, the one with the
shorter last step takes over, then the one of lower index. Nothing is lost: let x be the cell
of lowest rank in that order from which n is reached optimally. Whatever optimal predecessor
x has, the move to n cannot be dropped there, for the y that took over would be of lower
rank, or n's cost would not be optimal. (After the canonical orderings of Sturtevant and
Rabin 2016 and the jump points of Harabor and Grastien 2011, who prune in the plane.)
"""

from __future__ import annotations

import numba as nb
import numpy as np

from uavexp.arrays import Float, Int

STAY = 13
MOVES = 27
FULL = (1 << MOVES) - 1
_SAME = 1e-9


def _steps() -> Int:
    axis = (-1, 0, 1)
    return np.array([(i, j, k) for i in axis for j in axis for k in axis], dtype=np.int64)


def _boxes(steps: Int) -> Int:
    """Bits (27, 27) of the cells of the box between two cells; all ones and more when apart."""
    low = np.minimum(steps[:, None], steps[None])[:, :, None]
    high = np.maximum(steps[:, None], steps[None])[:, :, None]
    inside = ((steps >= low) & (steps <= high)).all(axis=3)
    boxes = (inside * (1 << np.arange(MOVES))).sum(axis=2)
    joined = (np.abs(steps[:, None] - steps[None]) <= 1).all(axis=2)
    return np.where(joined, boxes, 1 << MOVES)


def _spared(steps: Int, boxes: Int) -> Int:
    """Bits (27, 27, M): the move n after arriving by m is not needed where one of them is free.

    Of each set of alternatives those are left out that ask for more than another; the
    rest of a row is filled with bits that no neighbourhood has.
    """
    apart = np.sqrt(((steps[:, None] - steps[None]) ** 2).sum(axis=2).astype(np.float64))
    rows: dict[tuple[int, int], list[int]] = {}
    for arrived in range(MOVES):
        before = MOVES - 1 - arrived
        for n in range(MOVES):
            if STAY in (arrived, n):
                continue
            longer = apart[before] + apart[:, n] - apart[before, STAY] - apart[STAY, n]
            index = np.arange(MOVES)
            first = (apart[:, n] < apart[STAY, n] - _SAME) | (
                (apart[:, n] < apart[STAY, n] + _SAME) & (index < STAY)
            )
            spared = (longer < -_SAME) | ((longer < _SAME) & first)
            spared &= (boxes[before] < 1 << MOVES) & (boxes[:, n] < 1 << MOVES) & (index != STAY)
            needs = sorted({int(b) for b in (boxes[before] | boxes[:, n])[spared]}, key=int.bit_count)
            least: list[int] = []
            for need in needs:
                if all(need & other != other for other in least):
                    least.append(need)
            rows[arrived, n] = least
    table = np.full((MOVES, MOVES, max(map(len, rows.values()))), 1 << MOVES, dtype=np.int64)
    for (arrived, n), least in rows.items():
        table[arrived, n, : len(least)] = least
    return table


STEPS = _steps()  # (27, 3)
LENGTHS: Float = np.sqrt((STEPS**2).sum(axis=1).astype(np.float64))
BOXES = _boxes(STEPS)[STAY]  # (27,) cells that a move passes through, ends included
SPARED = _spared(STEPS, _boxes(STEPS))


@nb.njit(cache=True)
def open_moves(bits: int) -> int:
    """Which moves a neighbourhood leaves open, as bits (staying is none)."""
    moves = 0
    for n in range(27):
        if n != 13 and bits & BOXES[n] == BOXES[n]:
            moves |= 1 << n
    return int(moves)


@nb.njit(cache=True)
def canonical_moves(arrived: int, bits: int) -> int:
    """Which open moves continue a canonical path, as bits.

    Args:
        arrived: move by which the cell was reached; `STAY` at the start, where all are kept.
        bits: its neighbourhood.
    """
    moves = int(open_moves(bits))
    if arrived == 13:
        return moves
    for n in range(27):
        if moves >> n & 1:
            for m in range(SPARED.shape[2]):
                need = SPARED[arrived, n, m]
                if bits & need == need:
                    moves ^= 1 << n
                    break
                if need > 0x7FFFFFF:
                    break
    return moves

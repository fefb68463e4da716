"""Least costs of ways over cells, spreading from one cell as far as somebody asks (numba).

Dijkstra (1959) with Dial's (1969) buckets: costs are integers, hundredths of a cell, so a ring of
buckets serves as queue. A cell that is improved is entered anew; the old entry is skipped when its
turn comes. Cells lie flat on a plane with a blocked margin one cell wide, so no step asks for the
border. A straight step costs the mean of both cells' costs, a diagonal one sqrt(2) times that,
rounded down; no corner is cut: both cells beside a diagonal step must be passable.

A wave is kept while cells change (`forget`): up to the first cost at which a change can matter it
stands, beyond it spreads again.
"""

from __future__ import annotations

from typing import NamedTuple

import numba as nb
import numpy as np

from uavexp.arrays import Float32, Int, Int32, UInt8
from uavexp.mapping.projection import Part

FAR = 2**31 - 1
STRAIGHT, DIAGONAL = 100, 141  # steps between cells of the least cost
_SLANT = 0.7071067811865476
_BUCKETS = 1024  # > the longest step, sqrt(2) times the greatest cost
_RING = _BUCKETS - 1


class Wave(NamedTuple):
    """Costs from one cell; those below `now` are final."""

    cost: Int32  # (N,) of the way to each cell; FAR where the wave has not been
    head: Int32  # (1024,) first entry of each bucket
    following: Int32  # (M,) next entry of its bucket
    cell: Int32  # (M,) of each entry
    order: Int32  # (N,) cells in the order in which the wave left them
    clock: Int  # (5,) now, entries waiting, entries made, cost of the source cell, cells left


def new_wave(cells: int) -> Wave:
    """A wave that has not begun; memory that it does not come to use costs nothing."""
    entries = 8 * cells + 1  # a cell is improved once by each neighbour at most
    return Wave(
        np.full(cells, FAR, np.int32),
        np.full(_BUCKETS, -1, np.int32),
        np.empty(entries, np.int32),
        np.empty(entries, np.int32),
        np.empty(cells, np.int32),
        np.zeros(5, np.int64),
    )


@nb.njit(cache=True, inline="always")
def _enter(wave: Wave, cell: int, cost: int) -> None:
    """Give a cell this cost."""
    entry, slot = wave.clock[2], cost & _RING
    wave.cost[cell] = cost
    wave.cell[entry], wave.following[entry] = cell, wave.head[slot]
    wave.head[slot] = entry
    wave.clock[1] += 1
    wave.clock[2] += 1


@nb.njit(cache=True)
def begin(wave: Wave, source: int, source_cost: int) -> None:
    """Begin at a cell, which is left even if it is not passable; `source_cost` is its own."""
    for entry in range(wave.clock[2]):
        wave.cost[wave.cell[entry]] = FAR
    wave.head[:] = -1
    wave.clock[:] = 0
    wave.clock[3] = source_cost
    _enter(wave, source, 0)


@nb.njit(cache=True)
def reach(wave: Wave, kind: UInt8, width: int, price: Int32, goal: int, most: int) -> int:
    """Cost of the way to a cell; FAR when there is none, or none of a cost up to `most`.

    Args:
        wave: is let spread that far.
        kind: (N,) of each cell.
        width: cells in a row, margin included.
        price: (K,) cost of a cell of each kind, 100 to 500; 0: not passable.
        goal: cell.
        most: cost.
    """
    if price[kind[goal]] == 0:
        return FAR
    cost = wave.cost
    now = wave.clock[0]
    while wave.clock[1] > 0 and now < cost[goal] and now <= most:
        entry = wave.head[now & _RING]
        if entry < 0:
            now += 1
            continue
        wave.head[now & _RING] = wave.following[entry]
        wave.clock[1] -= 1
        at = wave.cell[entry]
        if cost[at] != now:
            continue
        wave.order[wave.clock[4]] = at
        wave.clock[4] += 1
        here = price[kind[at]]
        if here == 0:  # the source
            here = wave.clock[3]
        for a in range(-1, 2):
            for b in range(-1, 2):
                near = at + a * width + b
                there = price[kind[near]]
                if there == 0 or near == at:
                    continue
                if a != 0 and b != 0:
                    if price[kind[at + a * width]] == 0 or price[kind[at + b]] == 0:
                        continue
                    reached = now + int((here + there) * _SLANT)
                else:
                    reached = now + (here + there) // 2
                if reached < cost[near]:
                    _enter(wave, near, reached)
    wave.clock[0] = now
    return cost[goal] if cost[goal] <= min(now, most) else FAR


@nb.njit(cache=True)
def forget(wave: Wave, level: int) -> None:
    """Take back every cost above the level; every passable cell has the least price.

    What costs at most `level` must hold as it is, and cells from which a step leads beyond are
    left anew.
    """
    cost, order, clock = wave.cost, wave.order, wave.clock
    if clock[4] == 0:  # the source is still waiting, and has reached nothing
        return
    level = max(min(level, clock[0] - 1), 0)
    for cell in wave.cell[: clock[2]]:  # all that were reached since the last time
        if cost[cell] > level:
            cost[cell] = FAR
    wave.head[:] = -1
    clock[0], clock[1], clock[2] = max(level - DIAGONAL + 1, 0), 0, 0
    while clock[4] > 0 and cost[order[clock[4] - 1]] > level - DIAGONAL:
        clock[4] -= 1
        cell = order[clock[4]]
        if cost[cell] <= level:
            _enter(wave, cell, cost[cell])
        else:
            cost[cell] = FAR


@nb.njit(cache=True)
def mark_kinds(
    state: UInt8, clearance: Float32, parts: Int, inside: Part, clearance_m: np.float32,
    vehicle: tuple[int, int], escape2: float, kind: UInt8, target: Wave,
) -> int:  # fmt: skip
    """Mark what parts of the plane are to a wave: 0 not passable, else 1 + their state.

    Args:
        state: (X, Y) of the planar map.
        clearance: (X, Y) m.
        parts: (P, 4) rows from, to, columns from, to.
        inside: the part within the flight bounds.
        clearance_m: that passable cells exceed.
        vehicle: cell.
        escape2: squared cells around it in which any clearance will do.
        kind: ((X + 2) * (Y + 2),) is written.
        target: wave from the target, every passable cell at the least price.

    Returns:
        The cost from the target up to which nothing has changed: below that of a cell that is no
        longer passable, and at most a step above the neighbours of a cell that is so now.
    """
    width, level = state.shape[1] + 2, np.int64(FAR)
    i0, i1, j0, j1 = inside
    for n in range(parts.shape[0]):
        for i in range(max(parts[n, 0], i0), min(parts[n, 1], i1)):
            for j in range(max(parts[n, 2], j0), min(parts[n, 3], j1)):
                at = (i + 1) * width + j + 1
                room = clearance[i, j]
                near = (i - vehicle[0]) ** 2 + (j - vehicle[1]) ** 2 <= escape2
                now = 1 + state[i, j] if room > clearance_m or (room > 0.0 and near) else 0
                if now == 0 and kind[at] > 0:
                    level = min(level, target.cost[at] - 1)
                elif now > 0 and kind[at] == 0:
                    for a in range(-1, 2):
                        for b in range(-1, 2):
                            level = min(level, target.cost[at + a * width + b] + STRAIGHT)
                kind[at] = now
    return int(level)

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

from uavexp.arrays import Bool, Float32, Int, Int32, UInt8
from uavexp.field import UNKNOWN
from uavexp.mapping.projection import Part

FAR = 2**31 - 1
STRAIGHT, DIAGONAL = 100, 141  # steps between cells of the least cost
NEAR_WALL, WALL_LEVELS = 4, 8  # kinds of unknown cells by their distance from a wall
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
def forget(wave: Wave, level: int, longest: int) -> None:
    """Take back every cost above the level.

    What costs at most `level` must hold as it is, and cells from which a step, of cost `longest` at
    most, leads beyond are left anew.
    """
    cost, order, clock = wave.cost, wave.order, wave.clock
    level, waiting = max(min(level, clock[0] - 1), 0), -1
    for cell in wave.cell[: clock[2]]:  # all that were reached since the last time
        if cost[cell] == 0:
            waiting = cell  # the source, if it has not been left since then
        if cost[cell] > level:
            cost[cell] = FAR
    wave.head[:] = -1
    clock[0], clock[1], clock[2] = max(level - longest + 1, 0), 0, 0
    while clock[4] > 0 and cost[order[clock[4] - 1]] > level - longest:
        clock[4] -= 1
        cell = order[clock[4]]
        if cost[cell] <= level:
            _enter(wave, cell, cost[cell])
        else:
            cost[cell] = FAR
    if clock[2] == 0 and clock[4] == 0 and waiting >= 0:
        _enter(wave, waiting, 0)


@nb.njit(cache=True)
def mark_kinds(
    state: UInt8, clearance: Float32, parts: Int, inside: Part, clearance_m: np.float32, wall_m: np.float32,
    closed: Bool, vehicle: tuple[int, int], escape2: float, kind: UInt8, price: Int32, target: Wave,
) -> int:  # fmt: skip
    """Mark what parts of the plane are to a wave: 0 not passable, else 1 + their state, or `NEAR_WALL` on.

    Args:
        state: (X, Y) of the planar map.
        clearance: (X, Y) m.
        parts: (P, 4) rows from, to, columns from, to.
        inside: the part within the flight bounds.
        clearance_m: that passable cells exceed.
        wall_m: unknown cells of less clearance are told apart, in `WALL_LEVELS` from the wall on; 0: none.
        closed: (X, Y) cells that are not passable whatever is known of them.
        vehicle: cell.
        escape2: squared cells around it in which any clearance will do.
        kind: ((X + 2) * (Y + 2),) is written.
        price: of each kind in the wave from the target.
        target: that wave.

    Returns:
        The cost from the target up to which nothing has changed: below that of a cell whose price
        is another now, and at most that of its neighbours.
    """
    width, level = state.shape[1] + 2, np.int64(FAR)
    i0, i1, j0, j1 = inside
    for n in range(parts.shape[0]):
        for i in range(max(parts[n, 0], i0), min(parts[n, 1], i1)):
            for j in range(max(parts[n, 2], j0), min(parts[n, 3], j1)):
                at = (i + 1) * width + j + 1
                room = clearance[i, j]
                near = (i - vehicle[0]) ** 2 + (j - vehicle[1]) ** 2 <= escape2
                fits = room > clearance_m or (room > 0.0 and near)
                now = 1 + state[i, j] if fits and not closed[i, j] else 0
                if now == 1 + UNKNOWN and room < wall_m:
                    now = NEAR_WALL + int(WALL_LEVELS * max(room, np.float32(0.0)) / wall_m)
                before = kind[at]
                if price[now] != price[before]:
                    level = min(level, target.cost[at] - 1)
                    for a in range(-1, 2):
                        for b in range(-1, 2):
                            level = min(level, target.cost[at + a * width + b])
                kind[at] = now
    return int(level)


@nb.njit(cache=True)
def way_back(wave: Wave, kind: UInt8, width: int, price: Int32, start: int) -> Int32:
    """Cells (N,) of the least way from a cell that the wave has reached to its source, both included."""
    cost = wave.cost
    cells = np.empty(cost.shape[0], np.int32)
    at, count = start, 0
    while True:
        cells[count] = at
        count += 1
        if cost[at] == 0:
            return cells[:count].copy()
        here, best, least = price[kind[at]], at, np.int64(FAR)
        for a in range(-1, 2):
            for b in range(-1, 2):
                near = at + a * width + b
                if cost[near] >= cost[at]:
                    continue
                there = wave.clock[3] if cost[near] == 0 and price[kind[near]] == 0 else price[kind[near]]
                if a != 0 and b != 0:
                    if price[kind[at + a * width]] == 0 or price[kind[at + b]] == 0:
                        continue
                    step = int((here + there) * _SLANT)
                else:
                    step = (here + there) // 2
                if cost[near] + step < least:
                    best, least = near, np.int64(cost[near] + step)
        if best == at:
            return cells[:0].copy()
        at = best

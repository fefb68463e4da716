"""Least costs of ways over cells of space, spreading from one cell as far as somebody asks (numba).

As `explorer.waves` on the plane: Dijkstra (1959) with Dial's (1969) buckets, costs in hundredths of a
cell. Here a bucket is a list through the cells themselves, so a wave takes six numbers a cell however
often costs fall. A step to one of 26 neighbours costs its length times the mean price of both cells.
Corners may be cut: what divides rooms is at least two cells thick where the clearance is kept. Where every
passable cell costs the same, steps that `volume.steps` spares are not tried.

A wave is kept while cells change (`forget`): up to the least cost that a change can touch it stands.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numba as nb
import numpy as np

from uavexp.arrays import Bool, Int, Int32, UInt8
from uavexp.explorer.volume.steps import ANY_STEP, MOST_PRICE, UNIT, Prices, Steps
from uavexp.memory import blank

FAR = 2**31 - 1
_FACE, _CORNER = 141, 173  # steps across an edge and a corner
_BUCKETS = 1024  # > the longest step
_RING = _BUCKETS - 1
_LONGEST = int(MOST_PRICE * 1.7321 * UNIT) + 1
_NOW, _WAITING, _LEFT = 0, 1, 2


class Wave(NamedTuple):
    """Costs from one cell; those below `now` are final."""

    cost: Int32  # (N,) of the way to each cell; FAR where the wave has not been
    head: Int32  # (1024,) first cell of each bucket, -1: none
    following: Int32  # (N,) next cell of its bucket
    before: Int32  # (N,) the one before it, -1: it is the first
    came: Int32  # (N,) bits of the last steps of least ways to each cell; `ANY_STEP` as well
    order: Int32  # (N,) cells in the order in which the wave left them
    marked: Bool  # (N,) cells at which it pauses
    clock: Int  # (3,) now, cells waiting, cells left


def new_wave(cells: int) -> Wave:
    """A wave that has not begun; memory that it does not come to use costs nothing."""
    cost, marked = np.full(cells, FAR, np.int32), blank(cells, np.bool_)
    following, before, came, order = (blank(cells, np.int32) for _ in range(4))
    head = np.full(_BUCKETS, -1, np.int32)
    return Wave(cost, head, following, before, came, order, marked, np.zeros(3, np.int64))


@nb.njit(cache=True, inline="always")
def _link(head: Int32, following: Int32, before: Int32, cell: int, slot: int) -> None:
    """Put a cell into a bucket."""
    first = head[slot]
    following[cell], before[cell], head[slot] = first, -1, cell
    if first >= 0:
        before[first] = cell


@nb.njit(cache=True, inline="always")
def _unlink(head: Int32, following: Int32, before: Int32, cell: int, slot: int) -> None:
    """Take a cell out of its bucket."""
    ahead, behind = before[cell], following[cell]
    if ahead >= 0:
        following[ahead] = behind
    else:
        head[slot] = behind
    if behind >= 0:
        before[behind] = ahead


@nb.njit(cache=True)
def _wait(wave: Wave, cell: int, cost: int) -> None:
    """Let a cell wait to be left, with this cost, in all directions."""
    _link(wave.head, wave.following, wave.before, cell, cost & _RING)
    wave.cost[cell], wave.came[cell] = cost, ANY_STEP
    wave.clock[_WAITING] += 1


@nb.njit(cache=True)
def _empty_buckets(wave: Wave) -> None:
    """Take back the costs of all waiting cells."""
    for slot in range(_BUCKETS):
        cell = wave.head[slot]
        while cell >= 0:
            wave.cost[cell] = FAR
            cell = wave.following[cell]
        wave.head[slot] = -1
    wave.clock[_WAITING] = 0


@nb.njit(cache=True)
def begin(wave: Wave, source: int) -> None:
    """Begin at a cell, which is left even if it is not passable."""
    for cell in wave.order[: wave.clock[_LEFT]]:
        wave.cost[cell] = FAR
    _empty_buckets(wave)
    wave.clock[:] = 0
    _wait(wave, source, 0)


@nb.njit(cache=True)
def _advance(wave: Wave, kind: UInt8, steps: Steps, price: Prices, most: int) -> int:
    """Leave cells in the order of their costs up to `most`; the first marked one that was left, -1: none.

    Every array has a name of its own: looked up in their tuples, they cost more than all the rest.
    """
    cost, head, following, before, came, order, marked, clock = wave
    offset, behind, needed, after, instead = steps
    passable, toll, even = price.cell > 0.0, price.toll, price.even
    now, waiting, left, paused = clock[_NOW], clock[_WAITING], clock[_LEFT], -1
    while waiting > 0 and now <= most and paused < 0:
        at = head[now & _RING]
        if at < 0:
            now += 1
            continue
        head[now & _RING] = following[at]
        if following[at] >= 0:
            before[following[at]] = -1
        order[left] = at
        waiting, left = waiting - 1, left + 1
        if marked[at]:
            paused = at
        steps_to, here = came[at] if even else ANY_STEP, kind[at]
        for last in range(behind.shape[0]):
            if not steps_to >> last & 1:
                continue
            origin = at - behind[last]
            for n in range(needed[last]):
                step, spared = after[last, n], instead[last, n]
                near = at + offset[step]
                if not passable[kind[near]] or (spared >= 0 and passable[kind[origin + offset[spared]]]):
                    continue
                known, reached = cost[near], now + toll[here, kind[near], step]
                if reached < known:
                    if known < FAR:
                        _unlink(head, following, before, near, known & _RING)
                        waiting -= 1
                    _link(head, following, before, near, reached & _RING)
                    cost[near], came[near] = reached, 1 << step
                    waiting += 1
                elif reached == known:
                    came[near] |= 1 << step
    clock[_NOW], clock[_WAITING], clock[_LEFT] = now, waiting, left
    return paused


@nb.njit(cache=True)
def reach(wave: Wave, kind: UInt8, steps: Steps, price: Prices, goal: int, most: int) -> int:
    """Cost of the way to a cell; FAR when there is none, or none of a cost up to `most`.

    Args:
        wave: is let spread that far.
        kind: (N,) of each cell, margin included.
        steps: on the grid.
        price: of each kind.
        goal: cell.
        most: cost.
    """
    if wave.cost[goal] > wave.clock[_NOW]:
        wave.marked[goal] = True
        _advance(wave, kind, steps, price, most)
        wave.marked[goal] = False
    cost = wave.cost[goal]
    return int(cost) if cost <= min(wave.clock[_NOW], most) else FAR


@nb.njit(cache=True)
def reach_all(wave: Wave, kind: UInt8, steps: Steps, price: Prices, goals: Int, most: int) -> Int:
    """`reach` of many cells (G,)."""
    cost = np.empty(goals.shape[0], np.int64)
    for n in range(goals.shape[0]):
        cost[n] = reach(wave, kind, steps, price, goals[n], most)
    return cost


@nb.njit(cache=True, inline="always")
def _settle(p: int, there: int, group: Int, onward: Int, found: Int, reached: Bool, tally: Int) -> None:
    """Take note of the cost of the way to place number p."""
    if found[p] == FAR:
        tally[0] += not reached[group[p]]
        found[p], reached[group[p]], tally[1] = there, True, min(tally[1], there + onward[p])


@nb.njit(cache=True)
def reach_nearest(
    wave: Wave, kind: UInt8, steps: Steps, price: Prices, places: Int, group: Int, onward: Int, number: Int32,
    groups: int, spare: int,
) -> Int:  # fmt: skip
    """Costs (P,) of ways to the nearest places; FAR to those where the wave has not been when it stops.

    It stops when so many groups have a place, and when no place can still be less than `spare` worse, with
    what lies behind it, than the best.

    Args:
        wave: is let spread so far.
        kind: (N,) of each cell, margin included.
        steps: on the grid.
        price: of each kind.
        places: (P,) cells.
        group: (P,) that each belongs to, from 0 on.
        onward: (P,) cost from each to the end of all.
        number: (N,) zeros; is left so.
        groups: that are enough.
        spare: cost.
    """
    cost, marked, now = wave.cost, wave.marked, wave.clock[_NOW]
    found, beside = np.full(places.shape[0], FAR), np.empty(places.shape[0], np.int64)
    tally = np.array([0, FAR])  # groups that have a place, cost over the best one
    reached, least = np.zeros(places.shape[0], np.bool_), onward.min()
    for p in range(places.shape[0]):
        beside[p], number[places[p]] = number[places[p]] - 1, p + 1  # places may share a cell
        marked[places[p]] = True
        if cost[places[p]] <= now:
            _settle(p, cost[places[p]], group, onward, found, reached, tally)
    while tally[0] < groups:
        at = _advance(wave, kind, steps, price, tally[1] + spare - least)
        if at < 0:
            break
        p = number[at] - 1
        while p >= 0:
            _settle(p, cost[at], group, onward, found, reached, tally)
            p = beside[p]
    for p in range(places.shape[0]):
        number[places[p]], marked[places[p]] = 0, False
    return found


@nb.njit(cache=True)
def straight_cost(kind: UInt8, shape: tuple[int, int, int], price: Prices, start: int, end: int) -> int:
    """Cost of the least steps between two cells where cells of the least price fill the line; else FAR."""
    across, tall = shape[1] * shape[2], shape[2]
    x, y, z = start // across, start // tall % shape[1], start % tall
    dx, dy, dz = end // across - x, end // tall % shape[1] - y, end % tall - z
    longest = max(abs(dx), abs(dy), abs(dz))
    for n in range(longest + 1):
        share = n / max(longest, 1)
        i, j = math.floor(x + share * dx + 0.5), math.floor(y + share * dy + 0.5)
        at = i * across + j * tall + math.floor(z + share * dz + 0.5)
        if price.cell[kind[at]] != 1.0:
            return FAR
    shortest = min(abs(dx), abs(dy), abs(dz))
    middle = abs(dx) + abs(dy) + abs(dz) - longest - shortest
    return UNIT * (longest - middle) + _FACE * (middle - shortest) + _CORNER * shortest


@nb.njit(cache=True)
def trace(wave: Wave, kind: UInt8, steps: Steps, price: Prices, goal: int) -> Int:
    """Cells (P,) of the way to a cell, the source first; of one that was not reached, that cell alone."""
    cost = wave.cost
    way, count, before = np.empty(wave.clock[_LEFT] + 2, np.int64), 1, 0
    way[0] = at = goal
    while cost[at] > 0 and before < count < way.shape[0]:
        before = count
        for n in range(steps.offset.shape[0]):
            near = at - steps.offset[n]
            if cost[near] < cost[at] and (cost[near] + price.toll[kind[near], kind[at], n] == cost[at]):
                way[count] = at = near
                count += 1
                break
    return way[:count][::-1].copy()


@nb.njit(cache=True)
def forget(wave: Wave, level: int) -> None:
    """Take back every cost above the level and go on from there; what costs less must hold as it is.

    Args:
        wave: is changed.
        level: cost; the source stays in any case.
    """
    order, cost, clock = wave.order, wave.cost, wave.clock
    if clock[_LEFT] == 0:  # the source is still waiting, and has reached nothing
        return
    _empty_buckets(wave)
    while clock[_LEFT] > 1 and cost[order[clock[_LEFT] - 1]] > level:
        clock[_LEFT] -= 1
        cost[order[clock[_LEFT]]] = FAR
    last = cost[order[clock[_LEFT] - 1]]
    while clock[_LEFT] > 0 and cost[order[clock[_LEFT] - 1]] >= last - _LONGEST:
        clock[_LEFT] -= 1  # from here, steps lead beyond the level: it is left anew
        clock[_NOW] = cost[order[clock[_LEFT]]]
        _wait(wave, order[clock[_LEFT]], clock[_NOW])


@nb.njit(cache=True)
def least_change(wave: Wave, steps: Steps, cells: Int32) -> int:
    """The cost up to which a wave stands after these cells (C,) have changed their kind."""
    level = FAR
    for cell in cells:
        level = min(level, wave.cost[cell] - 1)
        for n in range(steps.offset.shape[0]):
            level = min(level, wave.cost[cell + steps.offset[n]])
    return int(level)

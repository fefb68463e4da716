"""Least costs of ways over cells of space, spreading from one cell as far as somebody asks (numba).

As `explorer.waves` on the plane: Dijkstra (1959) with Dial's (1969) buckets, costs in hundredths of a
cell. Here a bucket is a list through the cells themselves, so a wave takes five numbers a cell however
often costs fall. A step to one of 26 neighbours costs its length times the mean price of both cells.
Corners may be cut: what divides rooms is at least two cells thick where the clearance is kept.

A wave is kept while cells change (`forget`): up to the least cost that a change can touch it stands.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numba as nb
import numpy as np

from uavexp.arrays import Bool, Float, Int, Int32, UInt8
from uavexp.memory import blank

FAR = 2**31 - 1
UNIT = 100  # a straight step between cells of the least price
MOST_PRICE = 5.0
_FACE, _CORNER = 141, 173  # steps across an edge and a corner
_BUCKETS = 1024  # > the longest step
_RING = _BUCKETS - 1
_NOW, _WAITING, _LEFT = 0, 1, 2


class Wave(NamedTuple):
    """Costs from one cell; those below `now` are final."""

    cost: Int32  # (N,) of the way to each cell; FAR where the wave has not been
    head: Int32  # (1024,) first cell of each bucket, -1: none
    following: Int32  # (N,) next cell of its bucket
    before: Int32  # (N,) the one before it, -1: it is the first
    order: Int32  # (N,) cells in the order in which the wave left them
    clock: Int  # (3,) now, cells waiting, cells left


class Steps(NamedTuple):
    """The 26 steps on a grid laid flat."""

    offset: Int  # (26,)
    length: Int  # (26,) hundredths of a cell
    climbs: Int  # (26,) 1: up or down, 0: level


class Prices(NamedTuple):
    """What ways cost by the kinds of their cells; no step costs more than `MOST_PRICE` times its length."""

    cell: Float  # (K,) of a cell of each kind, 1 and more; 0: not passable
    climb: Float  # (K,) factor on steps up or down to or from it


def new_wave(cells: int) -> Wave:
    """A wave that has not begun; memory that it does not come to use costs nothing."""
    cost = np.full(cells, FAR, np.int32)
    following, before, order = (blank(cells, np.int32) for _ in range(3))
    return Wave(cost, np.full(_BUCKETS, -1, np.int32), following, before, order, np.zeros(3, np.int64))


def steps_on(shape: tuple[int, int, int]) -> Steps:
    """The steps on a grid of this shape (margin included)."""
    moves = np.array([m for m in np.ndindex(3, 3, 3) if m != (1, 1, 1)]) - 1
    length = np.floor(UNIT * np.linalg.norm(moves, axis=1) + 0.5).astype(np.int64)
    offset = moves @ np.array([shape[1] * shape[2], shape[2], 1])
    return Steps(offset, length, np.abs(moves[:, 2]))


@nb.njit(cache=True, inline="always")
def _enter(wave: Wave, cell: int, cost: int) -> None:
    """Give a cell this cost, and put it into the bucket of it."""
    slot = cost & _RING
    first = wave.head[slot]
    wave.cost[cell], wave.following[cell], wave.before[cell] = cost, first, -1
    if first >= 0:
        wave.before[first] = cell
    wave.head[slot] = cell
    wave.clock[_WAITING] += 1


@nb.njit(cache=True, inline="always")
def _remove(wave: Wave, cell: int) -> None:
    """Take a waiting cell out of its bucket."""
    ahead, behind = wave.before[cell], wave.following[cell]
    if ahead >= 0:
        wave.following[ahead] = behind
    else:
        wave.head[wave.cost[cell] & _RING] = behind
    if behind >= 0:
        wave.before[behind] = ahead
    wave.clock[_WAITING] -= 1


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
    _enter(wave, source, 0)


@nb.njit(cache=True, inline="always")
def _step_cost(steps: Steps, n: int, price: Prices, here: int, there: int) -> int:
    """What step number n costs between cells of these kinds; the first may be the source."""
    mean = 0.5 * (max(price.cell[here], 1.0) + price.cell[there])
    climb = max(price.climb[here], price.climb[there]) if steps.climbs[n] else 1.0
    return int(min(mean * climb, MOST_PRICE) * steps.length[n])


@nb.njit(cache=True, inline="always")
def _spread(wave: Wave, kind: UInt8, steps: Steps, price: Prices, at: int) -> None:
    """Enter the neighbours of a cell that are reached at less cost over it."""
    cost = wave.cost
    for n in range(steps.offset.shape[0]):
        near = at + steps.offset[n]
        if price.cell[kind[near]] == 0.0:
            continue
        reached = cost[at] + _step_cost(steps, n, price, kind[at], kind[near])
        if reached < cost[near]:
            if cost[near] < FAR:
                _remove(wave, near)
            _enter(wave, near, reached)


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
    cost = wave.cost
    now = wave.clock[_NOW]
    while wave.clock[_WAITING] > 0 and now < cost[goal] and now <= most:
        at = wave.head[now & _RING]
        if at < 0:
            now += 1
            continue
        _remove(wave, at)
        wave.order[wave.clock[_LEFT]] = at
        wave.clock[_LEFT] += 1
        _spread(wave, kind, steps, price, at)
    wave.clock[_NOW] = now
    return int(cost[goal]) if cost[goal] <= min(now, most) else FAR


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
    cost, clock = wave.cost, wave.clock
    found, beside = np.full(places.shape[0], FAR), np.empty(places.shape[0], np.int64)
    tally = np.array([0, FAR])  # groups that have a place, cost over the best one
    reached, least, now = np.zeros(places.shape[0], np.bool_), onward.min(), clock[_NOW]
    for p in range(places.shape[0]):
        beside[p], number[places[p]] = number[places[p]] - 1, p + 1  # places may share a cell
        if cost[places[p]] <= now:
            _settle(p, cost[places[p]], group, onward, found, reached, tally)
    while clock[_WAITING] > 0 and tally[0] < groups and now + least <= tally[1] + spare:
        at = wave.head[now & _RING]
        if at < 0:
            now += 1
            continue
        _remove(wave, at)
        wave.order[clock[_LEFT]] = at
        clock[_LEFT] += 1
        p = number[at] - 1
        while p >= 0:
            _settle(p, now, group, onward, found, reached, tally)
            p = beside[p]
        _spread(wave, kind, steps, price, at)
    clock[_NOW] = now
    for p in range(places.shape[0]):
        number[places[p]] = 0
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
            if cost[near] < cost[at] and (
                cost[near] + _step_cost(steps, n, price, kind[near], kind[at]) == cost[at]
            ):
                way[count] = at = near
                count += 1
                break
    return way[:count][::-1].copy()


@nb.njit(cache=True)
def forget(wave: Wave, kind: UInt8, steps: Steps, price: Prices, level: int) -> None:
    """Take back every cost above the level and go on from there; what costs less must hold as it is.

    Args:
        wave: is changed.
        kind: (N,) of each cell, as it is now.
        steps: on the grid.
        price: of each kind.
        level: cost; the source stays in any case.
    """
    order, cost, clock = wave.order, wave.cost, wave.clock
    if clock[_LEFT] == 0:  # the source is still waiting, and has reached nothing
        return
    _empty_buckets(wave)
    while clock[_LEFT] > 1 and cost[order[clock[_LEFT] - 1]] > level:
        clock[_LEFT] -= 1
        cost[order[clock[_LEFT]]] = FAR
    clock[_NOW] = cost[order[clock[_LEFT] - 1]]
    first = clock[_LEFT]
    longest = int(MOST_PRICE * 1.7321 * UNIT) + 1
    while first > 0 and cost[order[first - 1]] >= clock[_NOW] - longest:
        first -= 1
    for at in order[first : clock[_LEFT]]:  # from these, steps lead beyond the level
        _spread(wave, kind, steps, price, at)


@nb.njit(cache=True)
def least_change(wave: Wave, steps: Steps, cells: Int32) -> int:
    """The cost up to which a wave stands after these cells (C,) have changed their kind."""
    level = FAR
    for cell in cells:
        level = min(level, wave.cost[cell] - 1)
        for n in range(steps.offset.shape[0]):
            level = min(level, wave.cost[cell + steps.offset[n]])
    return int(level)

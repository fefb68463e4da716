"""A tour in an array, changed by flips only; neighbour lists and a tour to begin with (numba).

A tour is the pair of `tour` (node at each place) and `place` (place of each node). A flip
of the array between two places is its own inverse, so a row of the log holds these two, and
then the four nodes whose edges the flip changed.
"""

from __future__ import annotations

import numba as nb
import numpy as np

from uavexp.arrays import Float, Int32


@nb.njit(cache=True)
def nearest(cost: Float, count: int) -> Int32:
    """The `count` cheapest neighbours (N, count) of every node, nearest first, ties by number."""
    nodes = cost.shape[0]
    found = np.empty((nodes, count), dtype=np.int32)
    for node in range(nodes):
        size = 0
        for other in range(nodes):
            if other == node:
                continue
            if size == count and cost[node, other] >= cost[node, found[node, size - 1]]:
                continue
            place = size if size < count else count - 1
            while place > 0 and cost[node, found[node, place - 1]] > cost[node, other]:
                if place < count:
                    found[node, place] = found[node, place - 1]
                place -= 1
            found[node, place] = other
            size = min(size + 1, count)
    return found


@nb.njit(cache=True)
def nearest_neighbour_tour(cost: Float, first: int) -> Int32:
    """Tour (N,) that goes to the nearest unvisited node each time."""
    nodes = cost.shape[0]
    tour = np.empty(nodes, dtype=np.int32)
    visited = np.zeros(nodes, dtype=np.bool_)
    here = first
    for step in range(nodes):
        tour[step] = here
        visited[here] = True
        best = -1
        for other in range(nodes):
            if not visited[other] and (best < 0 or cost[here, other] < cost[here, best]):
                best = other
        here = best
    return tour


@nb.njit(cache=True)
def flip(tour: Int32, place: Int32, first: int, last: int) -> None:
    """Reverse the stretch from place `first` on to place `last`, round the end; the shorter side moves."""
    nodes = tour.shape[0]
    inside = last - first + 1
    if inside <= 0:
        inside += nodes
    if 2 * inside > nodes:  # reversing the rest gives the same cycle
        first, last = last + 1, first - 1
        inside = nodes - inside
        if first == nodes:
            first = 0
        if last < 0:
            last += nodes
    for _ in range(inside // 2):
        a, b = tour[first], tour[last]
        tour[first], tour[last] = b, a
        place[b], place[a] = first, last
        first = first + 1 if first + 1 < nodes else 0
        last = last - 1 if last > 0 else nodes - 1


@nb.njit(cache=True)
def reverse(
    tour: Int32, place: Int32, log: Int32, used: int, outside: int, a: int, b: int
) -> tuple[Int32, int]:
    """Reverse the path from a to b, `outside` being the node before a; returns the log and its length."""
    if used == log.shape[0]:
        log = np.concatenate((log, np.empty_like(log)))
    if beside(tour, place, a, False) == outside:
        first, last = place[a], place[b]
    else:
        first, last = place[b], place[a]
    log[used, 0], log[used, 1] = first, last
    log[used, 2], log[used, 3] = a, b
    log[used, 4] = beside(tour, place, tour[first], False)
    log[used, 5] = beside(tour, place, tour[last], True)
    flip(tour, place, first, last)
    return log, used + 1


@nb.njit(cache=True)
def undo(tour: Int32, place: Int32, log: Int32, used: int, until: int) -> None:
    """Take back all flips after the first `until`."""
    for entry in range(used - 1, until - 1, -1):
        flip(tour, place, log[entry, 0], log[entry, 1])


@nb.njit(cache=True, inline="always")
def beside(tour: Int32, place: Int32, node: int, forward: bool) -> int:
    """Neighbour of a node on the tour, after it or before it."""
    at = place[node] + (1 if forward else -1)
    if at == tour.shape[0]:
        at = 0
    elif at < 0:
        at = tour.shape[0] - 1
    return int(tour[at])

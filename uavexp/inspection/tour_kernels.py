"""Lin-Kernighan search on an array tour (numba).

Everything that changes the tour is a flip: a stretch of it is reversed. A Lin-Kernighan
step is one flip, an Or-opt move and a double bridge are three. So one log of flips undoes
whatever did not pay.

- Step (Lin and Kernighan 1973): with t1 -> t2 broken, join t2 to a near t3, break t4 -> t3
  where t4 comes before t3, close t4 to t1: the stretch t2..t4 is reversed. Go on from the
  new neighbour of t1 while the gain of the open chain stays positive; keep the best close.
- Or-opt (Or 1976): up to three consecutive nodes move between two near neighbours, either
  way round; the one 3-opt move that a chain of such steps finds only by luck.
- Neighbour lists and don't-look bits (Bentley 1992): only nodes whose edges changed are
  looked at again.
- Kick (Martin, Otto, Felten 1991): a double bridge over short neighbouring stretches
  (Applegate, Cook, Rohe 2003), repaired, and undone when the tour got longer.
"""

from __future__ import annotations

import numba as nb
import numpy as np

from uavexp.arrays import Float, Int32, UInt8
from uavexp.inspection.tour_array import beside, reverse, undo

BREADTH = 5  # alternatives tried at the first step of a chain; 1 after it
DEPTH = 8  # steps of a chain
STRETCH = 50  # longest stretch of a kick, nodes
LOG = 1024  # flips that the log of one kick has room for at first
_GAIN = 1e-9  # less is rounding


@nb.njit(cache=True)
def _step(
    cost: Float, near: Int32, tour: Int32, place: Int32, t1: int, t2: int, open_gain: float, rank: int
) -> tuple[int, int]:
    """The step of this rank from the open chain t1, t2: (t3, t4), or (-1, -1).

    Ranked by what is broken less what is joined, d(t4, t3) - d(t2, t3).
    """
    backward = beside(tour, place, t1, True) != t2
    worths = np.full(rank + 1, -np.inf)
    nodes = np.full(rank + 1, -1, dtype=np.int64)
    for item in range(near.shape[1]):
        t3 = near[t2, item]
        if open_gain - cost[t2, t3] <= _GAIN:
            break
        t4 = beside(tour, place, t3, backward)
        if t3 == t1 or t4 == t2:
            continue
        worth = cost[t4, t3] - cost[t2, t3]
        slot = rank + 1
        while slot > 0 and worth > worths[slot - 1]:
            slot -= 1
        if slot <= rank:
            worths[slot + 1 :] = worths[slot:rank].copy()
            nodes[slot + 1 :] = nodes[slot:rank].copy()
            worths[slot], nodes[slot] = worth, t3
    t3 = nodes[rank]
    return t3, (beside(tour, place, t3, backward) if t3 >= 0 else -1)


@nb.njit(cache=True)
def _chain(
    cost: Float, near: Int32, tour: Int32, place: Int32, log: Int32, used: int, t1: int, t2: int, rank: int
) -> tuple[float, Int32, int]:
    """Best chain from the broken edge t1, t2, applied; returns its gain, -1 if it has no first step."""
    open_gain = cost[t1, t2]
    best_gain, best_used = 0.0, used
    for depth in range(DEPTH):
        t3, t4 = _step(cost, near, tour, place, t1, t2, open_gain, rank if depth == 0 else 0)
        if t3 < 0:
            if depth == 0:
                return -1.0, log, used
            break
        log, used = reverse(tour, place, log, used, t1, t2, t4)
        open_gain += cost[t4, t3] - cost[t2, t3]
        gain = open_gain - cost[t4, t1]
        if gain > best_gain + _GAIN:
            best_gain, best_used = gain, used
        t2 = t4
    undo(tour, place, log, used, best_used)
    return best_gain, log, best_used


@nb.njit(cache=True)
def _chains(
    cost: Float, near: Int32, tour: Int32, place: Int32, log: Int32, used: int, t1: int
) -> tuple[float, Int32, int]:
    """The first chain from t1, either way, that shortens the tour, applied."""
    for forward in (True, False):
        t2 = beside(tour, place, t1, forward)
        for rank in range(BREADTH):
            gain, log, now = _chain(cost, near, tour, place, log, used, t1, t2, rank)
            if gain > 0.0:
                return gain, log, now
            if gain < 0.0:
                break
    return 0.0, log, used


@nb.njit(cache=True)
def _stretch(
    cost: Float, near: Int32, tour: Int32, place: Int32, log: Int32, used: int, first: int, forward: bool
) -> tuple[float, Int32, int]:
    """Best Or-opt move of one to three nodes from `first` on, next to a near node, applied."""
    nodes = tour.shape[0]
    before = beside(tour, place, first, not forward)
    last = first
    best_gain, best_last, best_u, best_v, best_turned = _GAIN, -1, -1, -1, False
    for size in range(1, min(4, nodes - 2)):
        if size > 1:
            last = beside(tour, place, last, forward)
        after = beside(tour, place, last, forward)
        freed = cost[before, first] + cost[last, after] - cost[before, after]
        for item in range(near.shape[1]):
            c = near[first, item]  # becomes the neighbour of `first`
            if freed - cost[first, c] <= best_gain:
                break
            ahead = (place[c] - place[first]) % nodes if forward else (place[first] - place[c]) % nodes
            if ahead < size:
                continue  # c is in the stretch
            for turned in (False, True):  # c, first..last, d  or  d, last..first, c along the tour
                if c == (after if turned else before):
                    continue  # that edge is one of the stretch's own
                d = beside(tour, place, c, forward != turned)
                gain = freed + cost[c, d] - cost[c, first] - cost[last, d]
                if gain > best_gain:
                    best_gain, best_last, best_turned = gain, last, turned
                    best_u, best_v = (d, c) if turned else (c, d)
    if best_last < 0:
        return 0.0, log, used
    after = beside(tour, place, best_last, forward)
    ahead = (
        (place[best_u] - place[best_last]) % nodes if forward else (place[best_last] - place[best_u]) % nodes
    )
    if 2 * ahead <= nodes:  # before [first..last] [after..u] v
        log, used = reverse(tour, place, log, used, before, first, best_u)
        log, used = reverse(tour, place, log, used, before, best_u, after)
    else:  # u [v..before] [first..last] after
        log, used = reverse(tour, place, log, used, best_u, best_v, best_last)
        log, used = reverse(tour, place, log, used, first, before, best_v)
    if not best_turned:
        log, used = reverse(tour, place, log, used, best_u, best_last, first)
    return best_gain, log, used


@nb.njit(cache=True)
def _kick(
    cost: Float, tour: Int32, place: Int32, log: Int32, at: int, sizes: tuple[int, int]
) -> tuple[float, Int32, int]:
    """Double bridge: the stretch from place `at` on and the one behind it change places."""
    nodes = tour.shape[0]
    o, q = tour[at - 1], tour[(at + sizes[0] + sizes[1]) % nodes]
    a1, a2 = tour[at], tour[(at + sizes[0] - 1) % nodes]
    b1, b2 = tour[(at + sizes[0]) % nodes], tour[(at + sizes[0] + sizes[1] - 1) % nodes]
    gain = cost[o, a1] + cost[a2, b1] + cost[b2, q] - cost[o, b1] - cost[b2, a1] - cost[a2, q]
    log, used = reverse(tour, place, log, 0, o, a1, b2)
    log, used = reverse(tour, place, log, used, o, b2, b1)
    log, used = reverse(tour, place, log, used, b2, a2, a1)
    return gain, log, used


@nb.njit(cache=True)
def _mend(
    cost: Float,
    near: Int32,
    tour: Int32,
    place: Int32,
    log: Int32,
    used: int,
    wake: UInt8,
    queue: Int32,
    waiting: int,
) -> tuple[float, Int32, int]:
    """Shorten the tour until no node in the queue, nor any woken by a change, finds a gain.

    `wake` flags the nodes in the queue, a ring whose first `waiting` entries count.
    """
    nodes = tour.shape[0]
    total, head = 0.0, 0
    while waiting > 0:
        node = queue[head]
        head = (head + 1) % nodes
        waiting -= 1
        wake[node] = 0
        begin = used
        gain, log, used = _chains(cost, near, tour, place, log, used, node)
        if gain <= 0.0:
            gain, log, used = _stretch(cost, near, tour, place, log, used, node, True)
        if gain <= 0.0:
            gain, log, used = _stretch(cost, near, tour, place, log, used, node, False)
        if gain <= 0.0:
            continue
        total += gain
        for entry in range(begin, used):
            for column in range(2, 6):
                woken = log[entry, column]
                if wake[woken] == 0:
                    wake[woken] = 1
                    queue[(head + waiting) % nodes] = woken
                    waiting += 1
    return total, log, used


@nb.njit(cache=True)
def search(cost: Float, near: Int32, start: Int32, kicks: int, rng: np.random.Generator) -> Int32:
    """Tour (N,) shortened by a Lin-Kernighan search and so many kicks.

    Args:
        cost: symmetric (N, N), N >= 5.
        near: neighbour lists (N, K), nearest first.
        start: tour to begin with (N,).
        kicks: double bridges tried.
        rng: draws where they fall.
    """
    nodes = start.shape[0]
    tour = start.copy()
    place = np.empty(nodes, dtype=np.int32)
    place[tour] = np.arange(nodes, dtype=np.int32)
    log = np.empty((LOG, 6), dtype=np.int32)
    wake = np.ones(nodes, dtype=np.uint8)
    queue = tour.copy()
    _, log, used = _mend(cost, near, tour, place, log, 0, wake, queue, nodes)
    longest = max(1, min(STRETCH, (nodes - 2) // 2))
    for _ in range(kicks):
        sizes = (1 + int(rng.random() * longest), 1 + int(rng.random() * longest))
        gain, log, used = _kick(cost, tour, place, log, int(rng.random() * nodes), sizes)
        waiting = 0
        for entry in range(used):
            for column in range(2, 6):
                node = log[entry, column]
                if wake[node] == 0:
                    wake[node] = 1
                    queue[waiting] = node
                    waiting += 1
        mended, log, used = _mend(cost, near, tour, place, log, used, wake, queue, waiting)
        if gain + mended < -_GAIN:
            undo(tour, place, log, used, 0)
    return tour

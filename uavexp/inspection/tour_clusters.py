"""From a tour over viewpoints to runs of one segment, merged and reordered (paper 3, algorithm 1).

A cluster is a run of consecutive viewpoints of one segment. Neighbours in the tour never
share a segment, so "nearest adjacent cluster from the same segment" is read as the previous
or the next run of that segment, whichever is nearer; the smaller of the two moves to the
other (METHODS.md). A merge that would lengthen the visit beyond a limit is left undone
[ours]: a tour often passes a segment twice for good reason, and the paper sets no limit.
"""

from __future__ import annotations

import math

import numpy as np

from uavexp.arrays import Float, Int
from uavexp.inspection.tour import open_tour, tour_length

Clusters = tuple[tuple[int, ...], ...]  # viewpoints of each cluster, in the order of visit

SWEEPS = 3  # of the reordering over all clusters: each changes the ends its neighbours see
REORDER_KICKS = 10  # per viewpoint of a cluster


def clusters_of(order: Int, segment: Int) -> Clusters:
    """Runs of one segment (Remap).

    Args:
        order: viewpoints in the order of visit (V,).
        segment: of each viewpoint (V,).
    """
    if len(order) == 0:
        return ()
    breaks = np.flatnonzero(np.diff(segment[order])) + 1
    return tuple(tuple(int(v) for v in run) for run in np.split(order, breaks))


def merged(
    clusters: Clusters, segment: Int, cost: Float, start: Float, size: int, limit_m: float = math.inf
) -> Clusters:
    """Clusters smaller than `size` merged into the nearest run of their segment (MergeOutlier).

    The merge that lengthens the visit least comes first. Runs that become neighbours by it are
    joined too.

    Args:
        clusters: runs in the order of visit.
        segment: of each viewpoint (V,).
        cost: travel lengths between viewpoints (V, V), m.
        start: travel lengths from the vehicle to each viewpoint (V,), m.
        size: tau.
        limit_m: length of the visit that no merge may exceed.
    """
    length_m = visit_length_m(clusters, cost, start)
    while True:
        pairs = _pairs(clusters, segment, size)
        added = [_lengthening_m(clusters, *pair, cost, start) for pair in pairs]
        if not added or length_m + min(added) > limit_m:
            return clusters
        goes, stays = pairs[int(np.argmin(added))]
        length_m += min(added)
        runs = list(clusters)
        runs[stays] = clusters[min(goes, stays)] + clusters[max(goes, stays)]
        del runs[goes]
        clusters = _joined(runs, segment)


def _pairs(clusters: Clusters, segment: Int, size: int) -> list[tuple[int, int]]:
    """Places (goes, stays) of runs next to each other in one segment, one of them smaller than `size`."""
    latest: dict[int, int] = {}
    pairs = []
    for place, run in enumerate(clusters):
        before = latest.get(int(segment[run[0]]))
        latest[int(segment[run[0]])] = place
        if before is not None and min(len(run), len(clusters[before])) < size:
            smaller_first = len(clusters[before]) < len(run)
            pairs.append((before, place) if smaller_first else (place, before))
    return pairs


def _lengthening_m(clusters: Clusters, goes: int, stays: int, cost: Float, start: Float) -> float:
    """What the visit grows by when one run moves next to another, before or behind it as it came, m."""

    def leg(here: int | None, there: int | None) -> float:
        if there is None:
            return 0.0
        return float(start[there] if here is None else cost[here, there])

    def last_before(place: int) -> int | None:
        return clusters[place - 1][-1] if place > 0 else None

    def first_after(place: int) -> int | None:
        return clusters[place + 1][0] if place + 1 < len(clusters) else None

    first, last = clusters[goes][0], clusters[goes][-1]
    here, there = last_before(goes), first_after(goes)
    saved = leg(here, first) + leg(last, there) - leg(here, there)
    if goes > stays:
        here, there = clusters[stays][-1], first_after(stays)
    else:
        here, there = last_before(stays), clusters[stays][0]
    return leg(here, first) + leg(last, there) - leg(here, there) - saved


def _joined(runs: list[tuple[int, ...]], segment: Int) -> Clusters:
    """Neighbouring runs of one segment as one."""
    together: list[tuple[int, ...]] = []
    for run in runs:
        if together and segment[together[-1][0]] == segment[run[0]]:
            together[-1] = together[-1] + run
        else:
            together.append(run)
    return tuple(together)


def merge_outliers(
    clusters: Clusters,
    segment: Int,
    cost: Float,
    start: Float,
    largest: int,
    max_lengthening: float = math.inf,
) -> Clusters:
    """`merged` with tau growing by one from 2 to `largest` (tau_max); 1 merges nothing.

    `max_lengthening` is the share by which all merges together may lengthen the visit.
    """
    limit_m = (1.0 + max_lengthening) * visit_length_m(clusters, cost, start)
    for size in range(2, largest + 1):
        clusters = merged(clusters, segment, cost, start, size, limit_m)
    return clusters


def visit_length_m(clusters: Clusters, cost: Float, start: Float) -> float:
    """Length of the visit of all clusters from the vehicle; arguments as `merged`."""
    order = np.array([viewpoint for run in clusters for viewpoint in run], dtype=np.int64)
    return float(start[order[0]]) + tour_length(cost, order, closed=False) if len(order) else 0.0


def reordered(clusters: Clusters, cost: Float, start: Float) -> Clusters:
    """The same clusters in the same order, each visited in an order that shortens travel (LocalReorder).

    Args:
        clusters: runs in the order of visit.
        cost: travel lengths between viewpoints (V, V), m.
        start: travel lengths from the vehicle to each viewpoint (V,), m.
    """
    runs = [np.array(run) for run in clusters]
    for _ in range(SWEEPS):
        before = [run.copy() for run in runs]
        for place, run in enumerate(runs):
            enter = start[run] if place == 0 else cost[runs[place - 1][-1], run]
            leave = cost[run, runs[place + 1][0]] if place + 1 < len(runs) else None
            runs[place] = _shortest_way(run, cost[np.ix_(run, run)], enter, leave)
        if all(np.array_equal(a, b) for a, b in zip(before, runs, strict=True)):
            break
    return tuple(tuple(int(v) for v in run) for run in runs)


def _shortest_way(run: Int, cost: Float, enter: Float, leave: Float | None) -> Int:
    """A run's nodes (N,) in a shorter order between what comes before and behind, or as they are."""
    count = len(run)
    if count == 1:
        return run
    ends = 1 if leave is None else 2
    whole = np.zeros((count + ends, count + ends))
    whole[1 : count + 1, 1 : count + 1] = cost
    whole[0, 1 : count + 1] = whole[1 : count + 1, 0] = enter
    if leave is not None:
        whole[-1, 1:-1] = whole[1:-1, -1] = leave
        whole[0, -1] = whole[-1, 0] = 2.0 * float(whole.max())
    order = open_tour(whole, None if leave is None else count + 1, kicks=REORDER_KICKS * count)
    if tour_length(whole, order, closed=False) >= tour_length(whole, np.arange(count + ends), closed=False):
        return run
    return np.asarray(run[order[1 : count + 1] - 1])


def switches(clusters: Clusters) -> int:
    """How often the visit goes from one segment to another."""
    return max(0, len(clusters) - 1)

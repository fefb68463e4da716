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

from uavexp.inspection.tour import open_tour, tour_length
from uavexp.types import Float, Int

Clusters = tuple[tuple[int, ...], ...]  # viewpoints of each cluster, in the order of visit

SWEEPS = 3  # of the reordering over all clusters: each changes the ends its neighbours see
REORDER_KICKS = 2  # per viewpoint of a cluster


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

    Smallest first, then earliest. Runs that become neighbours by it are joined too.

    Args:
        clusters: runs in the order of visit.
        segment: of each viewpoint (V,).
        cost: travel lengths between viewpoints (V, V), m.
        start: travel lengths from the vehicle to each viewpoint (V,), m.
        size: tau.
        limit_m: length of the visit that no merge may exceed.
    """
    while True:
        small = sorted((len(run), place) for place, run in enumerate(clusters) if len(run) < size)
        tried = (_merged_at(clusters, place, segment, cost) for _, place in small)
        better = next((t for t in tried if t is not None and visit_length_m(t, cost, start) <= limit_m), None)
        if better is None:
            return clusters
        clusters = better


def _merged_at(clusters: Clusters, place: int, segment: Int, cost: Float) -> Clusters | None:
    """The clusters with the run at a place and the nearest of its segment made one; None: it has none."""
    pair = _pair(clusters, place, segment, cost)
    if pair is None:
        return None
    first, second = pair
    stays, goes = (first, second) if len(clusters[first]) >= len(clusters[second]) else (second, first)
    runs = list(clusters)
    runs[stays] = clusters[first] + clusters[second]
    del runs[goes]
    return _joined(runs, segment)


def _pair(runs: Clusters, place: int, segment: Int, cost: Float) -> tuple[int, int] | None:
    """Places of a run and of the nearest other run of its segment before or behind it, in order."""
    own = segment[runs[place][0]]
    before = next((n for n in range(place - 1, -1, -1) if segment[runs[n][0]] == own), None)
    behind = next((n for n in range(place + 1, len(runs)) if segment[runs[n][0]] == own), None)
    pairs = [(place, behind)] if behind is not None else []
    pairs += [(before, place)] if before is not None else []
    return min(pairs, key=lambda two: float(cost[np.ix_(runs[two[0]], runs[two[1]])].min()), default=None)


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
    order = open_tour(whole, None if leave is None else count + 1, kicks_per_node=REORDER_KICKS)
    if tour_length(whole, order, closed=False) >= tour_length(whole, np.arange(count + ends), closed=False):
        return run
    return np.asarray(run[order[1 : count + 1] - 1])


def switches(clusters: Clusters) -> int:
    """How often the visit goes from one segment to another."""
    return max(0, len(clusters) - 1)

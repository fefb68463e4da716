"""Statistical outlier removal, in slabs of bounded size."""

from __future__ import annotations

import numpy as np

from uavexp.arrays import Bool, Float
from uavexp.o3d import open3d

_SLAB_POINTS = 400_000  # points whose neighbours are sought at once
_HALO_M = 1.0  # neighbours are sought so far beyond a slab; further ones count as further than they are


def outliers(points_m: Float, neighbours: int, deviations: float) -> Bool:
    """Points (N,) whose mean distance to their neighbours is beyond the mean of all plus some deviations.

    The rule of Rusu et al. 2008 (PCL, Open3D). Neighbours are exact within 1 m of a slab of the
    cloud; a point that needs one further away is an outlier anyhow.

    Args:
        points_m: (N, 3), finite.
        neighbours: k nearest ones; all there are in smaller clouds.
        deviations: standard deviations above the mean.
    """
    count = len(points_m)
    if count < 3:  # a spread of two distances says nothing
        return np.zeros(count, dtype=np.bool_)
    mean_m = _mean_distances(points_m, min(neighbours, count - 1))
    finite = mean_m[np.isfinite(mean_m)]
    limit_m = finite.mean() + deviations * finite.std() if finite.size else np.inf
    # equal distances differ by rounding: a regular grid has no outlier
    return np.asarray(~(mean_m <= limit_m * (1.0 + 1e-9)))


def _mean_distances(points_m: Float, neighbours: int) -> Float:
    """Mean distance (N,) of each point to its nearest ones, inf where a slab holds too few."""
    axis = int(np.ptp(points_m, axis=0).argmax())
    order = np.argsort(points_m[:, axis], kind="stable")
    along = points_m[order, axis]
    mean_m = np.full(len(points_m), np.inf)
    for begin in range(0, len(order), _SLAB_POINTS):
        end = min(begin + _SLAB_POINTS, len(order))
        low, high = np.searchsorted(along, [along[begin] - _HALO_M, along[end - 1] + _HALO_M], "right")
        low, high = min(low, max(begin - neighbours, 0)), max(high, min(end + neighbours, len(order)))
        around = points_m[order[low:high]]
        tree = open3d.core.nns.NearestNeighborSearch(open3d.core.Tensor(around))
        tree.knn_index()
        squared = tree.knn_search(open3d.core.Tensor(points_m[order[begin:end]]), neighbours + 1)[1].numpy()
        # the point itself is the first of its neighbours
        mean_m[order[begin:end]] = np.sqrt(np.maximum(squared[:, 1:], 0.0)).mean(axis=1)
    return mean_m

"""Normals, curvature and free sides of surface points, on neighbours from Open3D."""

from __future__ import annotations

import numba as nb
import numpy as np

from uavexp.arrays import Bool, Float, Int32
from uavexp.o3d import open3d

MAX_NEIGHBOURS = 60  # of a point when its normal is fitted


@nb.njit(cache=True)
def towards_free(points: Float, free: Bool, origin: Float, voxel: float) -> Float:
    """Mean direction (N, 3) from each point's voxel to the free ones of its 26 neighbours; 0: none."""
    towards = np.zeros(points.shape)
    cell = np.empty(3, dtype=np.int64)
    for n in range(points.shape[0]):
        for axis in range(3):
            cell[axis] = int(np.floor((points[n, axis] - origin[axis]) / voxel))
        for i in range(max(cell[0] - 1, 0), min(cell[0] + 2, free.shape[0])):
            for j in range(max(cell[1] - 1, 0), min(cell[1] + 2, free.shape[1])):
                for k in range(max(cell[2] - 1, 0), min(cell[2] + 2, free.shape[2])):
                    if free[i, j, k]:
                        di, dj, dk = i - cell[0], j - cell[1], k - cell[2]
                        length = max(np.sqrt(di * di + dj * dj + dk * dk), 1.0)
                        towards[n, 0] += di / length
                        towards[n, 1] += dj / length
                        towards[n, 2] += dk / length
                        if not towards[n].any():  # both sides free: a sheet, told from a buried point
                            towards[n, 2] += 1e-9
    return towards


def fit_normals(points: Float, towards: Float, radius_m: float) -> tuple[Float, Float]:
    """Unit normals (N, 3) of either sign, and curvature (N,), of the points around each point.

    Only neighbours on the same side of the surface count: a wall has two, a corner several.
    """
    near = neighbours(points, radius_m, MAX_NEIGHBOURS)
    value, vector = np.linalg.eigh(_covariances(points, towards, near))
    spread = value.sum(axis=1)
    curvature = np.where(spread > 0.0, np.maximum(value[:, 0], 0.0) / np.maximum(spread, 1e-12), 1.0 / 3.0)
    return np.ascontiguousarray(vector[:, :, 0]), curvature


def neighbours(points_m: Float, radius_m: float, most: int) -> Int32:
    """Points near each point (N, K), at most so many, ascending, -1 where there are fewer (Open3D)."""
    tensor = open3d.core.Tensor(np.ascontiguousarray(points_m))
    tree = open3d.core.nns.NearestNeighborSearch(tensor)
    tree.hybrid_index(radius_m)
    found, _, _ = tree.hybrid_search(tensor, radius_m, min(most, len(points_m)))
    return np.sort(found.numpy().astype(np.int32), axis=1)


@nb.njit(cache=True)
def _covariances(points: Float, towards: Float, near: Int32) -> Float:
    """Covariance (N, 3, 3) of the neighbours whose free side is within 60° of the point's own."""
    covariance = np.zeros((points.shape[0], 3, 3))
    for n in range(points.shape[0]):
        own = np.sqrt((towards[n] ** 2).sum())
        for turn in range(2):  # the mean, then the products
            if turn == 0:
                mean, count = np.zeros(3), 0
            for m in near[n]:
                if m < 0:
                    continue
                other = np.sqrt((towards[m] ** 2).sum())
                alike = (towards[n] * towards[m]).sum()
                if min(own, other) > 1.0 and alike < 0.5 * own * other:
                    continue
                if turn == 0:
                    mean += points[m]
                    count += 1
                else:
                    d = points[m] - mean
                    for row in range(3):
                        for column in range(3):
                            covariance[n, row, column] += d[row] * d[column] / count
            if turn == 0:
                mean /= max(count, 1)
    return covariance


@nb.njit(cache=True)
def free_sides(points: Float, normal: Float, free: Bool, origin: Float, voxel: float) -> Bool:
    """Whether free space begins along the normal, and against it, (N, 2).

    The voxels that a plane cuts reach no farther from it than voxel * |normal|_1; what is
    farther lies behind another surface.
    """
    side = np.zeros((points.shape[0], 2), dtype=np.bool_)
    cell = np.empty(3, dtype=np.int64)
    for n in range(points.shape[0]):
        reach = voxel * np.abs(normal[n]).sum()
        for way in range(2):
            for step in range(1, 9):
                outside = False
                for axis in range(3):
                    along = normal[n, axis] * (1 - 2 * way) * reach * (step / 8.0 + 1e-6)
                    cell[axis] = int(np.floor((points[n, axis] + along - origin[axis]) / voxel))
                    outside |= cell[axis] < 0 or cell[axis] >= free.shape[axis]
                if not outside and free[cell[0], cell[1], cell[2]]:
                    side[n, way] = True
                    break
    return side

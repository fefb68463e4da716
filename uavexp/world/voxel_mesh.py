"""Occupied voxels to triangles: the faces between occupied and empty, merged to rectangles."""

from __future__ import annotations

import numba as nb
import numpy as np

from uavexp.arrays import Bool, Float, Float32, Int, Int32


def exposed_faces(occupied: Bool, origin_m: Float, voxel_m: Float) -> tuple[Float32, Int32]:
    """Return the closed surface of a voxel set.

    Args:
        occupied: (X, Y, Z).
        origin_m: lower corner of voxel (0, 0, 0) (3,).
        voxel_m: size of a voxel along each axis (3,).

    Returns:
        Vertices (4 Q, 3), m, and triangles (2 Q, 3), normals outward; Q rectangles.
    """
    quads = _rectangles(np.ascontiguousarray(np.pad(occupied, 1)))
    vertices = origin_m + (quads.reshape(-1, 3) - 1.0) * voxel_m
    first = 4 * np.arange(quads.shape[0])[:, None]
    triangles = (first + np.array([0, 1, 2, 0, 2, 3])).reshape(-1, 3)
    return vertices.astype(np.float32), triangles.astype(np.int32)


@nb.njit(cache=True)
def _rectangles(occupied: Bool) -> Int:
    """Corners (Q, 4, 3) of the rectangles, in voxels of the padded grid (empty on its border).

    Slice by slice, each exposed face not yet covered grows along the second axis, then the
    row grows along the first: the usual greedy merge.
    """
    quads = np.empty((1024, 4, 3), dtype=np.int64)
    count = 0
    shape = np.array(occupied.shape)
    at = np.zeros(3, dtype=np.int64)
    for axis in range(3):
        u, v = (axis + 1) % 3, (axis + 2) % 3
        for side in (0, 1):
            for level in range(1, shape[axis] - 1):
                mask = np.zeros((shape[u], shape[v]), dtype=np.bool_)
                for i in range(1, shape[u] - 1):
                    for j in range(1, shape[v] - 1):
                        at[axis], at[u], at[v] = level, i, j
                        inside = occupied[at[0], at[1], at[2]]
                        at[axis] += 2 * side - 1
                        mask[i, j] = inside and not occupied[at[0], at[1], at[2]]
                for i in range(1, shape[u] - 1):
                    for j in range(1, shape[v] - 1):
                        if not mask[i, j]:
                            continue
                        wide = 1
                        while mask[i, j + wide]:
                            wide += 1
                        tall = 1
                        while mask[i + tall, j : j + wide].all():
                            tall += 1
                        mask[i : i + tall, j : j + wide] = False
                        if count == quads.shape[0]:
                            quads = np.concatenate((quads, np.empty_like(quads)))
                        for corner in range(4):
                            far_u = corner == 1 or corner == 2
                            far_v = corner >= 2
                            n = corner if side == 1 else 3 - corner  # so that normals point out
                            quads[count, n, axis] = level + side
                            quads[count, n, u] = i + tall if far_u else i
                            quads[count, n, v] = j + wide if far_v else j
                        count += 1
    return quads[:count]

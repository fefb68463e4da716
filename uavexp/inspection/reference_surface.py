"""The reference map M_R as the cells of its surface, whatever the mesh is like.

Neither the order of a mesh's corners nor its closedness is relied on. Surface is where the
triangles are; its sides are where free space that the vehicle can reach begins within the
depth of a voxel. So inverted or missing normals, non-manifold edges, double sheets, holes
and plans that are not closed all give the cells that can be looked at, and no others.
"""

from __future__ import annotations

from dataclasses import dataclass

import numba as nb
import numpy as np
from scipy import ndimage

from uavexp.arrays import Bool, Float, Float32, Int, Int32, UInt8
from uavexp.errors import require_positive
from uavexp.field import FREE, DistanceField
from uavexp.inspection.normals import fit_normals, free_sides, towards_free
from uavexp.inspection.visibility import OCCUPIED
from uavexp.mapping.esdf import SignedDistance
from uavexp.triangle_grid import box_meets_triangle

_ROUNDING = 1e-4  # of a voxel: more than float32 corners are off, or a surface on a border is lost


@dataclass(frozen=True, slots=True, kw_only=True)
class Surface:
    """Cells of a surface, in a fixed order."""

    point_m: Float  # (N, 3)
    normal: Float  # (N, 3) unit, towards free space
    area_m2: Float  # (N,)
    curvature: Float  # (N,) least eigenvalue over the sum of all, 0 (plane) to 1/3

    def __len__(self) -> int:
        return int(self.point_m.shape[0])

    def part(self, chosen: Bool | Int) -> Surface:
        """Some of the cells."""
        return Surface(
            point_m=self.point_m[chosen],
            normal=self.normal[chosen],
            area_m2=self.area_m2[chosen],
            curvature=self.curvature[chosen],
        )


def reference_field(
    vertices_m: Float32,
    triangles: Int32,
    bounds_m: Float,
    voxel_size_m: float = 0.1,
    max_distance_m: float = 2.0,
) -> DistanceField:
    """Field of a mesh in which every voxel that a triangle touches is occupied, the rest free.

    Args:
        vertices_m: (V, 3).
        triangles: (F, 3); those with a corner that is not finite are left out.
        bounds_m: box that the field covers (2, 3).
        voxel_size_m: edge of a voxel.
        max_distance_m: truncation.
    """
    require_positive(voxel_size_m=voxel_size_m, max_distance_m=max_distance_m)
    size = np.ceil((bounds_m[1] - bounds_m[0]) / voxel_size_m - 1e-9).astype(int)
    shape = (int(size[0]), int(size[1]), int(size[2]))
    state = np.full(shape, FREE, dtype=np.uint8)
    origin = np.asarray(bounds_m[0], dtype=np.float64)
    _fill(_corners(vertices_m, triangles), origin, voxel_size_m, state)
    signed = SignedDistance(shape, voxel_size_m, max_distance_m)
    occupied = np.flatnonzero(state == OCCUPIED).astype(np.int32)
    signed.update(0.0, state, occupied, np.empty(0, dtype=np.int32))
    return DistanceField(
        origin_m=origin,
        voxel_size_m=voxel_size_m,
        max_distance_m=max_distance_m,
        distance=signed.distance,
        state=state,
    )


def surface_of_mesh(
    vertices_m: Float32,
    triangles: Int32,
    field: DistanceField,
    start_m: Float,
    cell_m: float = 0.2,
    radius_m: float = 0.25,
) -> Surface:
    """Cells of a mesh's surface; arguments as `reference_field` and `surface_of_cloud`."""
    points, areas = _samples(_corners(vertices_m, triangles), 0.5 * field.voxel_size_m)
    return surface_of_cloud(points, field, start_m, cell_m, radius_m, areas)


def surface_of_cloud(
    points_m: Float,
    field: DistanceField,
    start_m: Float,
    cell_m: float = 0.2,
    radius_m: float = 0.25,
    area_m2: Float | None = None,
) -> Surface:
    """Cells of a point cloud's surface.

    Args:
        points_m: (N, 3) in any order; those that are not finite or outside the field are left out.
        field: of the same map; its occupied voxels hold the points.
        start_m: (3,) a point in the free space from which the surface is looked at.
        cell_m: edge of the cubes that the points of one side are gathered in.
        radius_m: within which normals are fitted (Open3D).
        area_m2: (N,) that the points stand for; None: each voxel for one of its faces.

    Returns:
        the cells, in ascending order of cube and side; none when the start is in an obstacle.
    """
    require_positive(cell_m=cell_m, radius_m=radius_m)
    voxel = field.voxel_size_m
    areas = np.zeros(points_m.shape[0]) if area_m2 is None else area_m2
    usable = np.isfinite(points_m).all(axis=1)
    usable &= (np.abs(points_m - field.origin_m) < 1e6).all(axis=1)
    index = np.floor((points_m[usable] - field.origin_m) / voxel).astype(np.int64)
    inside = ((index >= 0) & (index < field.distance.shape)).all(axis=1)
    key = np.ravel_multi_index(tuple(index[inside].T), field.distance.shape)
    points, area = _gather(points_m[usable][inside], areas[usable][inside], key)
    if area_m2 is None:
        area = np.full(points.shape[0], voxel * voxel)
    if points.shape[0] == 0:
        return _empty()
    free = free_space(field, start_m)
    towards = towards_free(points, free, field.origin_m, voxel)
    bare = towards.any(axis=1)
    if not bare.any():
        return _empty()
    points, area, towards = points[bare], area[bare], towards[bare]
    normal, curvature = fit_normals(points, towards, radius_m)
    side = free_sides(points, normal, free, field.origin_m, voxel)
    faces = Surface(
        point_m=np.concatenate([points[side[:, 0]], points[side[:, 1]]]),
        normal=np.concatenate([normal[side[:, 0]], -normal[side[:, 1]]]),
        area_m2=np.concatenate([area[side[:, 0]], area[side[:, 1]]]),
        curvature=np.concatenate([curvature[side[:, 0]], curvature[side[:, 1]]]),
    )
    return _coarser(faces, field.origin_m, cell_m)


def free_space(field: DistanceField, start_m: Float) -> Bool:
    """Voxels (X, Y, Z) joined to the start's through faces of voxels that are not occupied."""
    label, _ = ndimage.label(field.state != OCCUPIED)
    index = np.floor((start_m - field.origin_m) / field.voxel_size_m).astype(np.int64)
    if (index < 0).any() or (index >= field.state.shape).any() or label[tuple(index)] == 0:
        return np.zeros(field.state.shape, dtype=np.bool_)
    joined: Bool = label == label[tuple(index)]
    return joined


def _empty() -> Surface:
    return Surface(
        point_m=np.zeros((0, 3)), normal=np.zeros((0, 3)), area_m2=np.zeros(0), curvature=np.zeros(0)
    )


def _corners(vertices_m: Float32, triangles: Int32) -> Float:
    """Corners (F, 3, 3) of the triangles that are finite."""
    corners = np.asarray(vertices_m, dtype=np.float64)[triangles].reshape(-1, 3, 3)
    return np.ascontiguousarray(corners[np.isfinite(corners).all(axis=(1, 2))])


@nb.njit(cache=True)
def _fill(corners: Float, origin: Float, voxel: float, state: UInt8) -> None:
    """Mark the voxels that a triangle touches as occupied; on a border between two, both."""
    identity = np.eye(3)
    half = np.full(3, (0.5 + _ROUNDING) * voxel)
    low, high = np.empty(3, dtype=np.int64), np.empty(3, dtype=np.int64)
    for f in range(corners.shape[0]):
        for axis in range(3):
            least, most = corners[f, :, axis].min(), corners[f, :, axis].max()
            low[axis] = int(max(np.floor((least - origin[axis]) / voxel - _ROUNDING), 0))
            high[axis] = int(min(np.floor((most - origin[axis]) / voxel + _ROUNDING), state.shape[axis] - 1))
        for i in range(low[0], high[0] + 1):
            for j in range(low[1], high[1] + 1):
                for k in range(low[2], high[2] + 1):
                    if state[i, j, k] != OCCUPIED:
                        centre = origin + (np.array([i, j, k]) + 0.5) * voxel
                        if box_meets_triangle(corners[f], centre, identity, half):
                            state[i, j, k] = OCCUPIED


@nb.njit(cache=True)
def _samples(corners: Float, spacing: float) -> tuple[Float, Float]:
    """Points (N, 3) on triangles, at most `spacing` apart, and the areas (N,) they stand for.

    Rows parallel to the longest edge, each cut into equal parts.
    """
    points, areas = np.empty((1024, 3)), np.empty(1024)
    count = 0
    for f in range(corners.shape[0]):
        first, longest = 0, -1.0
        for n in range(3):
            length = np.sqrt(((corners[f, (n + 1) % 3] - corners[f, n]) ** 2).sum())
            if length > longest:
                first, longest = n, length
        a, b, c = corners[f, first], corners[f, (first + 1) % 3], corners[f, (first + 2) % 3]
        area = 0.5 * np.linalg.norm(np.cross(b - a, c - a))
        if area <= 0.0:
            continue
        rows = int(np.ceil(2.0 * area / longest / spacing))
        for row in range(rows):
            near, far = row / rows, (row + 1) / rows
            middle = 0.5 * (near + far)
            parts = int(np.ceil(longest * (1.0 - near) / spacing))
            while count + parts > areas.shape[0]:
                points = np.concatenate((points, np.empty_like(points)))
                areas = np.concatenate((areas, np.empty_like(areas)))
            for part in range(parts):
                along = (1.0 - middle) * (part + 0.5) / parts
                points[count] = a + along * (b - a) + middle * (c - a)
                areas[count] = area * ((1.0 - near) ** 2 - (1.0 - far) ** 2) / parts
                count += 1
    return points[:count].copy(), areas[:count].copy()


def _gather(points: Float, area: Float, key: Int) -> tuple[Float, Float]:
    """Mean point and total area of the points of each key, in ascending order of keys."""
    _, owner, count = np.unique(key, return_inverse=True, return_counts=True)
    order = np.lexsort((*points.T, owner))  # sums do not depend on the order of the points
    total = np.zeros((count.shape[0], 3))
    np.add.at(total, owner[order], points[order])
    return total / count[:, None], np.bincount(owner[order], area[order], minlength=count.shape[0]).astype(
        np.float64
    )


def _coarser(faces: Surface, origin: Float, cell_m: float) -> Surface:
    """Faces gathered in cubes of `cell_m`, by the axis that their normal is nearest to."""
    if len(faces) == 0:
        return faces
    axis = np.abs(faces.normal).argmax(axis=1)
    sign = np.take_along_axis(faces.normal, axis[:, None], axis=1)[:, 0] > 0.0
    index = np.floor((faces.point_m - origin) / cell_m).astype(np.int64)
    key = np.ravel_multi_index((*index.T, axis, sign), (*(index.max(axis=0) + 1), 3, 2))
    _, owner, count = np.unique(key, return_inverse=True, return_counts=True)

    def mean(values: Float) -> Float:
        total = np.zeros((count.shape[0], values.shape[1]))
        np.add.at(total, owner, values)
        return np.asarray(total / count[:, None])

    normal = mean(faces.normal)
    return Surface(
        point_m=mean(faces.point_m),
        normal=normal / np.linalg.norm(normal, axis=1)[:, None],
        area_m2=np.bincount(owner, faces.area_m2).astype(np.float64),
        curvature=mean(faces.curvature[:, None])[:, 0],
    )

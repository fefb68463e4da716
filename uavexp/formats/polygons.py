"""Polygons, strips and fans of a mesh to triangles."""

from __future__ import annotations

from pathlib import Path

import numba as nb
import numpy as np

from uavexp.arrays import Bool, Float, Int
from uavexp.errors import WorldError

MAX_CORNERS = 10_000  # of a polygon; cutting a concave one takes time with their square


def triangulate(path: Path, vertices: Float, corners: Int, counts: Int) -> Int:
    """Return the triangles (F, 3) of polygons; those of fewer than three corners have none.

    A quad is cut along the diagonal that lies inside it, a larger polygon as a fan when it
    is convex, else ear by ear (Meisters 1975).

    Args:
        path: named in the errors.
        vertices: (V, 3).
        corners: (sum of counts,), indices of vertices, polygon after polygon.
        counts: (P,), corners of each polygon.

    Raises:
        WorldError: an index that names no vertex, a polygon of too many corners.
    """
    check_indices(path, corners, vertices.shape[0])
    if (counts == 3).all():
        return corners.reshape(-1, 3)
    if counts.size and counts.max() > MAX_CORNERS:
        raise WorldError(
            f"world file {path} has a polygon of {counts.max()} corners, at most {MAX_CORNERS} are "
            "allowed; triangulate it before"
        )
    first = np.cumsum(counts) - counts
    parts = [np.empty((0, 3), dtype=np.int64)]
    for count in np.unique(counts[counts >= 3]):
        polygons = corners[first[counts == count][:, None] + np.arange(count)]
        parts.append(_cut(vertices, polygons))
    return np.concatenate(parts)


def check_indices(path: Path, indices: Int, vertices: int) -> None:
    """Raise `WorldError` unless every index names one of so many vertices."""
    if indices.size and (indices.min() < 0 or indices.max() >= vertices):
        wrong = indices.min() if indices.min() < 0 else indices.max()
        raise WorldError(
            f"world file {path} is damaged or truncated: a face names vertex {wrong} of {vertices}, "
            "counted from 0"
        )


def strip(corners: Int) -> Int:
    """Return the triangles (F, 3) of a triangle strip, turned alike; -1 begins another strip."""
    if corners.size < 3:
        return np.empty((0, 3), dtype=np.int64)
    place = np.arange(corners.size)
    begin = np.maximum.accumulate(np.where(corners == -1, place + 1, 0))
    odd = ((place - begin) % 2 == 1)[:-2]
    triangles = np.stack([corners[:-2], corners[1:-1], corners[2:]], axis=1)
    triangles[odd] = triangles[odd][:, [1, 0, 2]]
    return _proper(triangles[(triangles != -1).all(axis=1)])


def fan(corners: Int) -> Int:
    """Return the triangles (F, 3) of a triangle fan."""
    if corners.size < 3:
        return np.empty((0, 3), dtype=np.int64)
    return _proper(np.stack([np.full(corners.size - 2, corners[0]), corners[1:-1], corners[2:]], axis=1))


def _proper(triangles: Int) -> Int:
    """Triangles of three different corners: strips turn around with others."""
    a, b, c = triangles.T
    proper: Int = triangles[(a != b) & (b != c) & (c != a)]
    return proper


def _cut(vertices: Float, polygons: Int) -> Int:
    """Triangles of polygons (P, K) of the same number of corners."""
    count = polygons.shape[1]
    if count == 3:
        return polygons
    reflex = _reflex(vertices[polygons])
    if count == 4:
        turned = reflex[:, 1] | reflex[:, 3]
        polygons = np.where(turned[:, None], np.roll(polygons, -1, axis=1), polygons)
        return polygons[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3)
    concave = reflex.any(axis=1)
    convex = polygons[~concave]
    fans = np.stack(
        [np.broadcast_to(convex[:, :1], convex[:, 2:].shape), convex[:, 1:-1], convex[:, 2:]], axis=-1
    )
    ears = [polygon[_ears(_flat(vertices[polygon]))] for polygon in polygons[concave]]
    return np.concatenate([fans.reshape(-1, 3), *ears])


def _normals(points: Float) -> Float:
    """Normals (P, 3) of polygons (P, K, 3), twice their area long (Newell's sum)."""
    relative = points - points[:, :1]
    normals: Float = np.cross(relative, np.roll(relative, -1, axis=1)).sum(axis=1)
    return normals


def _reflex(points: Float) -> Bool:
    """Corners (P, K) at which polygons (P, K, 3) turn against their own sense."""
    edge = np.roll(points, -1, axis=1) - points
    turn = np.cross(np.roll(edge, 1, axis=1), edge)
    reflex: Bool = np.einsum("pkj,pj->pk", turn, _normals(points)) < 0.0
    return reflex


def _flat(points: Float) -> Float:
    """Corners (K, 2) of a polygon (K, 3) in the plane that it is most parallel to, counter-clockwise."""
    normal = _normals(points[None])[0]
    axis = int(np.abs(normal).argmax())
    plane = [(axis + 1) % 3, (axis + 2) % 3] if normal[axis] >= 0.0 else [(axis + 2) % 3, (axis + 1) % 3]
    return np.ascontiguousarray(points[:, plane])


@nb.njit(cache=True)
def _ears(points: Float) -> Int:
    """Triangles (K - 2, 3), indices of corners, of a counter-clockwise polygon (K, 2).

    Where no ear is left, because the polygon crosses itself, the corner at hand is cut off.
    """
    count = points.shape[0]
    after = (np.arange(count) + 1) % count
    before = (np.arange(count) - 1) % count
    triangles = np.empty((count - 2, 3), dtype=np.int64)
    corner, tried, done = 0, 0, 0
    left = count
    while left > 3:
        a, b, c = before[corner], corner, after[corner]
        if tried > left or _is_ear(points, after, a, b, c):
            triangles[done] = a, b, c
            after[a], before[c] = c, a
            done, left, tried = done + 1, left - 1, 0
            corner = a
        else:
            tried += 1
            corner = c
    triangles[done] = before[corner], corner, after[corner]
    return triangles


@nb.njit(cache=True)
def _side(p: Float, q: Float, r: Float) -> float:
    """Twice the area of triangle p, q, r, positive when counter-clockwise."""
    side: float = (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0])
    return side


@nb.njit(cache=True)
def _is_ear(points: Float, after: Int, a: int, b: int, c: int) -> bool:
    """Whether triangle a, b, c lies inside the polygon: convex, and no other corner in it."""
    p, q, r = points[a], points[b], points[c]
    if _side(p, q, r) <= 0.0:
        return False
    other = after[c]
    while other != a:
        o = points[other]
        is_corner = (o == p).all() or (o == q).all() or (o == r).all()
        if not is_corner and _side(p, q, o) >= 0.0 and _side(q, r, o) >= 0.0 and _side(r, p, o) >= 0.0:
            return False
        other = after[other]
    return True

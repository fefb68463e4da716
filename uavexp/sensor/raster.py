"""Depth image of a triangle mesh by drawing every triangle, seen from both sides (numba).

Corners are taken into the image once, as (u, v, 1) times depth: p_i. The ray through pixel (u, v) meets
the triangle p_0 p_1 p_2 where the three edge functions

    e_i(u, v) = (p_j x p_k) . (u, v, 1)

have the sign of det = p_0 . (p_1 x p_2), and there 1 / depth = (e_0 + e_1 + e_2) / det (Olano and Greer
1997, "Triangle Scan Conversion using 2D Homogeneous Coordinates"). So nothing is clipped at the camera's
plane, and triangles that share an edge leave no gap: its function is the same number with the other sign.
All is linear in u: a row of a triangle is one run of pixels, compared and written without a branch.
A triangle whose plane holds the camera is seen edge-on, that is not at all; nor is one without area or that
is not finite.
"""

from __future__ import annotations

import math

import numba as nb
import numpy as np

from uavexp.arrays import Float, Float32, Int32

_PADDING_PX = 1e-3  # around a triangle's bounding box: edge functions decide, not the box


@nb.njit(cache=True)
def _see(vertices_m: Float32, intrinsics: Float, position_m: Float, rotation: Float, seen: Float) -> None:
    """Write the corners (V, 3) as (u, v, 1) times depth, pixels and m."""
    fx, fy, cx, cy = intrinsics
    for n in range(vertices_m.shape[0]):
        x = vertices_m[n, 0] - position_m[0]
        y = vertices_m[n, 1] - position_m[1]
        z = vertices_m[n, 2] - position_m[2]
        depth = rotation[0, 2] * x + rotation[1, 2] * y + rotation[2, 2] * z
        seen[n, 0] = fx * (rotation[0, 0] * x + rotation[1, 0] * y + rotation[2, 0] * z) + cx * depth
        seen[n, 1] = fy * (rotation[0, 1] * x + rotation[1, 1] * y + rotation[2, 1] * z) + cy * depth
        seen[n, 2] = depth


@nb.njit(cache=True, inline="always")
def _are_beyond(a: float, b: float, c: float, za: float, zb: float, zc: float, last: float) -> bool:
    """Whether three corners lie on the same outer side of the image, along one of its axes."""
    if a < -0.5 * za and b < -0.5 * zb and c < -0.5 * zc:
        return True
    end = last + 0.5
    return a > end * za and b > end * zb and c > end * zc


@nb.njit(cache=True, error_model="numpy", inline="always")
def _span(a: float, b: float, c: float, za: float, zb: float, zc: float, last: float) -> tuple[float, float]:
    """Pixels that a triangle can cover along one axis; all of them when it crosses the camera's plane."""
    if not min(za, zb, zc) > 0.0:
        return 0.0, last
    ua, ub, uc = a / za, b / zb, c / zc
    return max(min(ua, ub, uc) - _PADDING_PX, 0.0), min(max(ua, ub, uc) + _PADDING_PX, last)


@nb.njit(cache=True, error_model="numpy", inline="always")
def _cut(low: float, high: float, constant: float, slope: float) -> tuple[float, float]:
    """Cut [low, high] to where constant + slope * u >= 0; high < low: nothing is left."""
    if slope > 0.0:
        low = max(low, -constant / slope)
    elif slope < 0.0:
        high = min(high, -constant / slope)
    elif constant < 0.0:
        high = -1.0
    return low, high


@nb.njit(cache=True, error_model="numpy")
def _draw(
    xa: float, ya: float, za: float, xb: float, yb: float, zb: float, xc: float, yc: float, zc: float,
    intrinsics: Float, inverse: Float32, plane_m: Float32,
) -> None:  # fmt: skip
    """Draw one triangle over what is there, where it is nearer."""
    height, width = inverse.shape
    ua, va, wa = yb * zc - zb * yc, zb * xc - xb * zc, xb * yc - yb * xc  # edge functions of u, v, 1
    ub, vb, wb = yc * za - zc * ya, zc * xa - xc * za, xc * ya - yc * xa
    uc, vc, wc = ya * zb - za * yb, za * xb - xa * zb, xa * yb - ya * xb
    det = ua * xa + va * ya + wa * za
    if not 0.0 < abs(det) < np.inf:
        return
    left, right = _span(xa, xb, xc, za, zb, zc, width - 1.0)
    top, bottom = _span(ya, yb, yc, za, zb, zc, height - 1.0)
    if not (left <= right and top <= bottom):
        return
    du, dv, constant = (ua + ub + uc) / det, (va + vb + vc) / det, (wa + wb + wc) / det  # inverse depth
    fx, fy, cx, cy = intrinsics
    across, down, along = du * fx, dv * fy, du * cx + dv * cy + constant
    distance = np.float32(1.0 / math.sqrt(across * across + down * down + along * along))
    side, step = math.copysign(1.0, det), np.float32(du)
    for v in range(math.ceil(top), math.floor(bottom) + 1):
        low, high = _cut(left, right, side * (va * v + wa), side * ua)
        low, high = _cut(low, high, side * (vb * v + wb), side * ub)
        low, high = _cut(low, high, side * (vc * v + wc), side * uc)
        if not low <= high:
            continue
        first, end = math.ceil(low), math.floor(high) + 1
        start = np.float32(dv * v + constant + du * first)
        here, plane = inverse[v, first:end], plane_m[v, first:end]
        for n in range(here.shape[0]):
            value = start + step * np.float32(n)
            nearer = value > here[n]
            plane[n] = distance if nearer else plane[n]
            here[n] = value if nearer else here[n]


@nb.njit(cache=True)
def rasterise(
    vertices_m: Float32, triangles: Int32, intrinsics: Float, position_m: Float, rotation: Float,
    seen: Float, inverse: Float32, plane_m: Float32,
) -> None:  # fmt: skip
    """Draw a mesh.

    Args:
        vertices_m: (V, 3).
        triangles: (F, 3) rows of `vertices_m`.
        intrinsics: (4,) fx, fy, cx, cy.
        position_m: (3,) of the camera.
        rotation: (3, 3) camera to world.
        seen: (V, 3) scratch.
        inverse: (H, W) filled with 1 / depth along the optical axis, 1 / m; 0 where nothing is met.
        plane_m: (H, W) filled with the camera's distance from the plane of the triangle met.
    """
    height, width = inverse.shape
    inverse[:] = np.float32(0.0)
    plane_m[:] = np.float32(0.0)
    _see(vertices_m, intrinsics, position_m, rotation, seen)
    for n in range(triangles.shape[0]):
        a, b, c = triangles[n, 0], triangles[n, 1], triangles[n, 2]
        za, zb, zc = seen[a, 2], seen[b, 2], seen[c, 2]
        if za <= 0.0 and zb <= 0.0 and zc <= 0.0:
            continue
        xa, xb, xc = seen[a, 0], seen[b, 0], seen[c, 0]
        if _are_beyond(xa, xb, xc, za, zb, zc, width - 1.0):
            continue
        ya, yb, yc = seen[a, 1], seen[b, 1], seen[c, 1]
        if _are_beyond(ya, yb, yc, za, zb, zc, height - 1.0):
            continue
        _draw(xa, ya, za, xb, yb, zb, xc, yc, zc, intrinsics, inverse, plane_m)

"""Bodies of a few numbers as closed meshes, turned outward; round ones are never smaller than they are."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from uavexp.arrays import Float, Int
from uavexp.formats.polygons import triangulate

SIDES = 48  # of a circle: 0.2 % of the radius lie between it and its corners
Mesh = tuple[Float, Int]  # vertices (V, 3), triangles (F, 3)


def box(size: Float) -> Mesh:
    """Return a box about the origin, of a size (3,)."""
    corners = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
    quads = np.array([[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]])
    return corners * size, quads[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3)


def cylinder(radius: float, length: float) -> Mesh:
    """Return an upright cylinder about the origin."""
    return revolved(np.array([[0.0, -1.0], [1.0, -1.0], [1.0, 1.0], [0.0, 1.0]]) * [radius, 0.5 * length])


def cone(radius: float, length: float) -> Mesh:
    """Return a cone about the origin, its tip up."""
    return revolved(np.array([[0.0, -0.5], [1.0, -0.5], [0.0, 0.5]]) * [radius, length])


def ellipsoid(radii: Float) -> Mesh:
    """Return an ellipsoid about the origin, of radii (3,)."""
    vertices, triangles = revolved(_arc(-0.5 * np.pi, 0.5 * np.pi))
    return vertices * radii, triangles


def capsule(radius: float, length: float) -> Mesh:
    """Return an upright capsule about the origin; length: of its cylinder, without the caps."""
    lower, upper = radius * _arc(-0.5 * np.pi, 0.0), radius * _arc(0.0, 0.5 * np.pi)
    lower[:, 1] -= 0.5 * length
    upper[:, 1] += 0.5 * length
    return revolved(np.concatenate([lower, upper]))


def prism(path: Path, outline: Float, height: float) -> Mesh:
    """Return what stands on an outline (N, 2) in the plane z = 0, as high as said."""
    x, y = outline.T
    if np.dot(x, np.roll(y, -1)) < np.dot(y, np.roll(x, -1)):  # clockwise
        outline = outline[::-1]
    count = outline.shape[0]
    vertices = np.concatenate([np.column_stack([outline, np.full(count, z)]) for z in (0.0, height)])
    top = triangulate(path, vertices, count + np.arange(count), np.array([count]))
    low, after = np.arange(count), (np.arange(count) + 1) % count
    sides = np.column_stack([low, after, count + after, low, count + after, count + low]).reshape(-1, 3)
    return vertices, np.concatenate([top, top[:, ::-1] - count, sides])


def rectangle(low: Float, high: Float) -> Mesh:
    """Return the rectangle between two corners (2,) in the plane z = 0, seen from above."""
    (x0, y0), (x1, y1) = low, high
    corners = np.array([[x0, y0, 0.0], [x1, y0, 0.0], [x1, y1, 0.0], [x0, y1, 0.0]])
    return corners, np.array([[0, 1, 2], [0, 2, 3]])


def revolved(profile: Float) -> Mesh:
    """Return the body that a profile (K, 2) of radius and z, from below to above, sweeps about z."""
    angle = 2.0 * np.pi * np.arange(SIDES) / SIDES
    radius = profile[:, :1] / np.cos(np.pi / SIDES)  # the middles of the sides lie on the circle
    z = np.broadcast_to(profile[:, 1:], (profile.shape[0], SIDES))
    vertices = np.stack([radius * np.cos(angle), radius * np.sin(angle), z], axis=-1).reshape(-1, 3)
    ring = SIDES * np.arange(profile.shape[0] - 1)[:, None]
    a, b = ring + np.arange(SIDES), ring + (np.arange(SIDES) + 1) % SIDES
    below = np.stack([a, b, b + SIDES], axis=-1)[profile[:-1, 0] > 0.0]  # at the axis they have no area
    above = np.stack([a, b + SIDES, a + SIDES], axis=-1)[profile[1:, 0] > 0.0]
    return vertices, np.concatenate([below.reshape(-1, 3), above.reshape(-1, 3)])


def _arc(first: float, last: float) -> Float:
    """Profile of a unit sphere between two latitudes in radians, outside it."""
    steps = round(0.5 * SIDES * (last - first) / np.pi)
    latitude = np.linspace(first, last, steps + 1)
    radius = np.where(np.abs(latitude) < 0.5 * np.pi - 1e-9, np.cos(latitude), 0.0)
    arc: Float = np.column_stack([radius, np.sin(latitude)]) / np.cos(0.5 * (last - first) / steps)
    return arc

"""Small buildings for inspection tests: boxes as triangles, and what is known of them exactly."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from uavexp.arrays import Float, Float32, Int32
from uavexp.field import DistanceField
from uavexp.inspection.reference_surface import Surface, reference_field, surface_of_mesh

START_M = np.array([1.03, 1.02, 1.21])


class Building(NamedTuple):
    vertices_m: Float32
    triangles: Int32
    field: DistanceField
    flight_bounds_m: Float


def boxes(*corners: tuple[tuple[float, float, float], tuple[float, float, float]]) -> tuple[Float32, Int32]:
    """Closed boxes from lower and upper corners, normals outward."""
    unit = np.array([(i, j, k) for i in (0, 1) for j in (0, 1) for k in (0, 1)], dtype=float)
    quads = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
    faces = np.array([(q[0], q[n], q[n + 1]) for q in quads for n in (1, 2)])
    vertices = [np.array(low) + unit * (np.array(high) - np.array(low)) for low, high in corners]
    triangles = [faces + 8 * n for n in range(len(corners))]
    return np.concatenate(vertices).astype(np.float32), np.concatenate(triangles).astype(np.int32)


def two_rooms(size: tuple[float, float, float] = (6.0, 4.0, 2.6)) -> tuple[Float32, Int32]:
    """A closed hall with a partition at x = 3 to 3.12 m, open for y > 2.6 m."""
    x, y, z = size
    t = 0.15
    return boxes(
        ((-t, -t, -t), (x + t, y + t, 0.0)),
        ((-t, -t, z), (x + t, y + t, z + t)),
        ((-t, -t, 0.0), (0.0, y + t, z)),
        ((x, -t, 0.0), (x + t, y + t, z)),
        ((0.0, -t, 0.0), (x, 0.0, z)),
        ((0.0, y, 0.0), (x, y + t, z)),
        ((3.0, 0.0, 0.0), (3.12, 2.6, z)),
    )


def building(mesh: tuple[Float32, Int32] | None = None) -> Building:
    vertices, triangles = mesh or two_rooms()
    bounds = np.array([[-0.35, -0.35, -0.35], [6.35, 4.35, 2.95]])
    inner = np.array([[0.3, 0.3, 0.4], [5.7, 3.7, 2.2]])
    return Building(vertices, triangles, reference_field(vertices, triangles, bounds), inner)


def surface_in(place: Building, start_m: Float = START_M) -> Surface:
    return surface_of_mesh(place.vertices_m, place.triangles, place.field, start_m)

"""Plans to surfaces: walls, floor and ceiling from z = 0 to the height of the walls."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from uavexp.arrays import Float, Int

Surface = tuple[Float, Int]  # vertices (V, 3) and triangles (F, 3)


def walls(lines: Sequence[Float], height: float) -> Surface:
    """Vertical faces along polylines (P, 2); their normals point to the right of the line."""
    begin = np.concatenate([line[:-1] for line in lines])
    end = np.concatenate([line[1:] for line in lines])
    corners = np.zeros((len(begin), 4, 3))  # of each face, around it
    corners[:, :, :2] = np.stack([begin, end, end, begin], axis=1)
    corners[:, 2:, 2] = height
    first = 4 * np.arange(len(begin))[:, None, None]
    return corners.reshape(-1, 3), (first + np.array([[0, 1, 2], [0, 2, 3]])).reshape(-1, 3)


def floor_and_ceiling(triangles: Float, height: float) -> Surface:
    """Two layers of triangles (T, 3, 2); their normals point away from each other."""
    one, other = triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    turned = one[:, 0] * other[:, 1] < one[:, 1] * other[:, 0]
    ceiling = np.where(turned[:, None, None], triangles[:, ::-1], triangles)  # counterclockwise from above
    corners = np.zeros((2, len(triangles), 3, 3))
    corners[0, ..., :2], corners[1, ..., :2] = ceiling[:, ::-1], ceiling
    corners[1, ..., 2] = height
    return corners.reshape(-1, 3), np.arange(6 * len(triangles)).reshape(-1, 3)


def rectangle(low: Float, high: Float) -> Float:
    """Two triangles (2, 3, 2) between two corners (2,)."""
    a, b, c, d = low, (high[0], low[1]), high, (low[0], high[1])
    return np.array([[a, b, c], [a, c, d]], dtype=np.float64)


def joined(parts: Iterable[Surface]) -> Surface:
    """One surface of several; vertices that several faces share are there once."""
    vertices, triangles, first = [], [], 0
    for points, faces in parts:
        vertices.append(points)
        triangles.append(faces + first)
        first += len(points)
    once, index = np.unique(np.concatenate(vertices), axis=0, return_inverse=True)
    return once, index.reshape(-1)[np.concatenate(triangles)]

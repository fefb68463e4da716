"""Local quadratic models: the obstacle cost of a spline's samples, half spaces around vectors."""

from __future__ import annotations

import numba as nb
import numpy as np

from uavexp.arrays import Float, Float32
from uavexp.field import value_and_gradient
from uavexp.planner.shape.scp import clearance_cost

# half spaces around a vector, in (along, level across, up from both): towards it and 24° from it
FAN = np.array(
    [
        [1.0, 0.0, 0.0],
        [0.91, 0.4146083, 0.0],
        [0.91, -0.4146083, 0.0],
        [0.91, 0.0, 0.4146083],
        [0.91, 0.0, -0.4146083],
    ]
)


def frames(vectors: Float) -> Float:
    """Unit vectors (K, 3, 3) along vectors (K, 3), level across them, and up from both.

    The world's own axes where a vector is zero or within 6° of the vertical.
    """
    norm = np.linalg.norm(vectors, axis=1)
    flat = np.hypot(vectors[:, 0], vectors[:, 1])
    steep = flat <= np.maximum(0.1 * norm, 1e-6)
    out = np.tile(np.eye(3), (len(vectors), 1, 1))
    kept = vectors[~steep]
    out[~steep, 0] = kept / norm[~steep, None]
    out[~steep, 1, :2] = np.stack([-kept[:, 1], kept[:, 0]], axis=1) / flat[~steep, None]
    out[~steep, 1, 2] = 0.0
    out[~steep, 2] = np.cross(out[~steep, 0], out[~steep, 1])
    return out


@nb.njit(cache=True)
def obstacle_cost(
    points: Float, distance: Float32, origin_m: Float, voxel_m: float, safe_m: float, hard_m: float
) -> float:
    """Sum over points (S, 3) of c(d) = (1 - d/safe)₊² + 10 ((hard - d)/safe)₊²."""
    d, _ = value_and_gradient(distance, origin_m, voxel_m, points)
    total = 0.0
    for k in range(len(points)):
        total += clearance_cost(d[k], safe_m, hard_m)
    return total


@nb.njit(cache=True)
def obstacle_model(
    points: Float,
    frame: Float,
    distance: Float32,
    origin_m: Float,
    voxel_m: float,
    safe_m: float,
    hard_m: float,
) -> tuple[Float, Float]:
    """Slope (S, 3) and non-negative curvature (S, 3, 3) of c at points (S, 3), each in its frame (3, 3).

    Differences over a voxel, not the gradient: it jumps on the medial axis of a gap, where
    Gauss-Newton would swing from wall to wall.
    """
    count = len(points)
    slope, bend = np.zeros((count, 3)), np.zeros((count, 3, 3))
    around = np.empty((7 * count, 3))
    for k in range(count):
        around[7 * k] = points[k]
        for e in range(3):
            around[7 * k + 1 + 2 * e] = points[k] + voxel_m * frame[k, e]
            around[7 * k + 2 + 2 * e] = points[k] - voxel_m * frame[k, e]
    d, _ = value_and_gradient(distance, origin_m, voxel_m, around)
    for k in range(count):
        middle = clearance_cost(d[7 * k], safe_m, hard_m)
        for e in range(3):
            ahead = clearance_cost(d[7 * k + 1 + 2 * e], safe_m, hard_m)
            behind = clearance_cost(d[7 * k + 2 + 2 * e], safe_m, hard_m)
            first = (ahead - behind) / (2.0 * voxel_m)
            second = max(ahead - 2.0 * middle + behind, 0.0) / voxel_m**2
            for a in range(3):
                slope[k, a] += first * frame[k, e, a]
                for b in range(3):
                    bend[k, a, b] += second * frame[k, e, a] * frame[k, e, b]
    return slope, bend

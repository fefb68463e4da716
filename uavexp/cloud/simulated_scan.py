"""A simulated scan: rays over the sphere from several poses, with range noise."""

from __future__ import annotations

import numpy as np

from uavexp.arrays import Float
from uavexp.scene import Scene

_GOLDEN = np.pi * (3.0 - np.sqrt(5.0))


def simulated_scan(
    scene: Scene, poses_m: Float, rays: int, range_m: float, noise_m: float, rng: np.random.Generator
) -> Float:
    """Points (N, 3) that a scanner at each pose (K, 3) measures.

    Args:
        scene: true geometry.
        poses_m: (K, 3).
        rays: of each pose, evenly over the sphere (Fibonacci spiral), turned at random.
        range_m: farther surfaces are not seen.
        noise_m: standard deviation of the range.
        rng: turns and noise.
    """
    n = np.arange(rays) + 0.5
    height = 1.0 - 2.0 * n / rays
    around = np.sqrt(1.0 - height**2)
    points = []
    for pose in poses_m:
        angle = _GOLDEN * n + rng.uniform(0.0, 2.0 * np.pi)
        direction = np.column_stack([around * np.cos(angle), around * np.sin(angle), height])
        row = np.hstack([np.broadcast_to(pose, direction.shape), direction])
        distance = scene.cast(row.astype(np.float32))[0].astype(np.float64)
        seen = distance <= range_m
        measured = distance[seen] + rng.normal(0.0, noise_m, int(seen.sum()))
        points.append(pose + measured[:, None] * direction[seen])
    return np.concatenate(points)

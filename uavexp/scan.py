"""What a sensor measured, with the pose that it is believed to be measured from."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uavexp.arrays import Float, Float32, check_shape


@dataclass(frozen=True, slots=True, kw_only=True)
class DepthScan:
    """One depth image with the pose it is believed to be taken from.

    Depth is along the optical axis: finite and > 0 is a return; +inf was measured to lie
    beyond `max_range_m` (free up to there); NaN is no measurement (tells nothing).
    """

    time_s: float
    depth_m: Float32  # (H, W)
    focal_px: tuple[float, float]  # fx, fy
    centre_px: tuple[float, float]  # cx, cy: optical axis, pixel (0, 0) has its centre at (0, 0)
    max_range_m: float
    camera_position_m: Float  # (3,) world
    camera_rotation: Float  # (3, 3) camera to world

    def __post_init__(self) -> None:
        check_shape("depth_m", self.depth_m, (None, None))
        check_shape("camera_rotation", self.camera_rotation, (3, 3))
        if not (np.isfinite(self.camera_position_m).all() and np.isfinite(self.camera_rotation).all()):
            raise ValueError("camera pose must be finite")
        if abs(float(np.linalg.det(self.camera_rotation)) - 1.0) > 1e-6:
            raise ValueError("camera_rotation must be a rotation")
        if not min(self.focal_px) > 0.0:
            raise ValueError(f"focal_px must be > 0, got {self.focal_px}")


@dataclass(frozen=True, slots=True, kw_only=True)
class RayScan:
    """Ranges along single rays (a LiDAR), with the pose they are believed to be taken from.

    Range is along the ray: finite and > 0 is a return; +inf was measured to lie beyond
    `max_range_m` (free up to there); NaN is no measurement (tells nothing).
    """

    time_s: float
    origin_m: Float  # (3,) world
    direction: Float32  # (N, 3) world, unit length
    range_m: Float32  # (N,)
    max_range_m: float

    def __post_init__(self) -> None:
        check_shape("origin_m", self.origin_m, (3,))
        check_shape("direction", self.direction, (None, 3))
        check_shape("range_m", self.range_m, (self.direction.shape[0],))
        if not np.isfinite(self.origin_m).all():
            raise ValueError("origin_m must be finite")


Scan = DepthScan | RayScan

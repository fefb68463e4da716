"""RGB-D depth camera: rays through every pixel and the noise of a structured-light sensor.

From the true depth z along the optical axis to the measured one, in this order:

1. missing returns at grazing angles: none where the angle between the ray and the normal of
   a surface within range exceeds `grazing_angle_deg`;
2. axial noise: z + N(0, sigma(z)), sigma(z) = 0.0012 + 0.0019 (z - 0.4)^2 m (Nguyen, Izadi
   and Lovell 2012, "Modeling Kinect Sensor Noise", axial noise up to 60°);
3. disparity quantisation: d = f b / z rounded to a multiple of `disparity_step_px`
   (Khoshelham and Elberink 2012: 1/8 px; b = 0.075 m, f = 580 px of its infrared camera);
4. missing returns at depth edges: a pixel at which inverse depth (linear over the image of
   any plane) has a second difference of more than `edge_ratio` of its largest value among
   the neighbours has none, with probability `edge_missing_probability`, on both sides;
5. range: below `min_range_m` (before quantisation) is NaN; beyond `max_range_m`, or no surface at
   all, is +inf.

A missing return is NaN. Every term has its switch. One normal and one uniform number is
drawn per pixel and frame whatever the image and the switches, so that streams stay aligned.
Left out: lateral noise, lens distortion, interference, motion blur, colour.
"""

from __future__ import annotations

import math
from dataclasses import field
from typing import Annotated

import numba as nb
import numpy as np

from uavexp.arrays import Float, Float32
from uavexp.errors import require
from uavexp.geometry import rotation_from_quaternion
from uavexp.parameters import NonNegative, Positive, Share, Vector, above, at_most, between, option
from uavexp.scan import DepthScan
from uavexp.scene import Scene
from uavexp.types import State


@nb.njit(cache=True)
def _aim(directions: Float32, origin_m: Float, rotation: Float, rays: Float32) -> None:
    """Write rays (N, 6) of camera-frame directions (N, 3) from a pose to `rays`."""
    for n in range(directions.shape[0]):
        x, y, z = directions[n, 0], directions[n, 1], directions[n, 2]
        for axis in range(3):
            rays[n, axis] = origin_m[axis]
            rays[n, 3 + axis] = rotation[axis, 0] * x + rotation[axis, 1] * y + rotation[axis, 2] * z


@nb.njit(cache=True)
def _measure(
    true_depth_m: Float32,  # (H, W), inf on a miss
    normal: Float32,  # (H * W, 3)
    rays: Float32,  # (H * W, 6)
    gaussian: Float32,  # (H, W)
    uniform: Float32,  # (H, W)
    min_range_m: float,
    max_range_m: float,
    axial_scale: float,
    disparity_unit_m: float,  # f b / step; 0: not quantised
    edge_ratio: float,
    edge_probability: float,
    least_cosine: float,
) -> Float32:
    """Measured depth (H, W) of a true one; see the module's list of terms."""
    height, width = true_depth_m.shape
    inverse = np.empty((height, width), dtype=np.float32)
    for v in range(height):
        for u in range(width):
            inverse[v, u] = 1.0 / max(true_depth_m[v, u], 1e-6)
    measured = np.empty((height, width), dtype=np.float32)
    for v in range(height):
        for u in range(width):
            true = true_depth_m[v, u]
            if uniform[v, u] < edge_probability and _at_edge(inverse, v, u, edge_ratio, 1.0 / max_range_m):
                measured[v, u] = np.nan
                continue
            if not true < np.inf:
                measured[v, u] = np.inf
                continue
            if true <= max_range_m and _is_grazed(normal, rays, v * width + u, least_cosine):
                measured[v, u] = np.nan
                continue
            depth = true + axial_scale * (0.0012 + 0.0019 * (true - 0.4) ** 2) * gaussian[v, u]
            if depth < min_range_m or depth <= 0.0:
                measured[v, u] = np.nan
                continue
            if disparity_unit_m > 0.0:
                steps = np.floor(disparity_unit_m / depth + 0.5)
                depth = disparity_unit_m / steps if steps > 0.0 else np.inf
            if depth > max_range_m:
                depth = np.inf
            measured[v, u] = depth
    return measured


@nb.njit(cache=True)
def _is_grazed(normal: Float32, rays: Float32, n: int, least_cosine: float) -> bool:
    """Whether ray n meets its surface at less than a cosine to the normal."""
    dx, dy, dz = rays[n, 3], rays[n, 4], rays[n, 5]
    along = abs(normal[n, 0] * dx + normal[n, 1] * dy + normal[n, 2] * dz)
    return bool(along < least_cosine * math.sqrt(dx * dx + dy * dy + dz * dz))


@nb.njit(cache=True)
def _at_edge(inverse: Float32, v: int, u: int, ratio: float, least: float) -> bool:
    """Whether inverse depth jumps at a pixel: its second difference along a row or column.

    Inverse depth is linear over the image of a plane, however steep: a floor is no edge.
    Nor is anything where all is farther than 1 / `least`.
    """
    here = inverse[v, u]
    if 0 < u < inverse.shape[1] - 1:
        left, right = inverse[v, u - 1], inverse[v, u + 1]
        largest = max(left, here, right)
        if largest >= least and abs(left - 2.0 * here + right) > ratio * largest:
            return True
    if 0 < v < inverse.shape[0] - 1:
        above, below = inverse[v - 1, u], inverse[v + 1, u]
        largest = max(above, here, below)
        if largest >= least and abs(above - 2.0 * here + below) > ratio * largest:
            return True
    return False


Pixels = Annotated[int, between(2, 4096)]


@option
class Rgbd:
    """RGB-D depth camera with switchable noise terms."""

    rate_hz: Positive = 20.0  # Hz; paper 1
    width_px: Pixels = 96  # px; a pixel at 5 m is about a voxel wide [ours]
    height_px: Pixels = 72  # px [ours]
    horizontal_fov_deg: Annotated[float, between(1, 170)] = 90.0  # deg; paper 1 (axis [ours])
    min_range_m: NonNegative = 0.2  # m, nearer surfaces give no measurement [ours]
    max_range_m: Positive = 5.0  # m, farther surfaces are measured as beyond range [ours]
    mount_offset_m: Vector = (0.0, 0.0, 0.0)  # m, camera in the body frame: forward, left, up [ours]
    mount_pitch_deg: Annotated[float, between(-90, 90)] = 0.0  # deg, optical axis above (+) or below
    # (-) body x [ours]
    axial_noise: bool = True  # sigma(z) = 0.0012 + 0.0019 (z - 0.4)^2 m; Nguyen et al. 2012
    quantisation: bool = True  # disparity rounded to steps; Khoshelham and Elberink 2012
    baseline_m: Positive = 0.075  # m, projector to infrared camera; Khoshelham and Elberink 2012
    disparity_focal_px: Positive = 580.0  # px, focal length of the infrared camera;
    # Khoshelham and Elberink 2012
    disparity_step_px: Positive = 0.125  # px; 0.07 m of depth at 5 m; Khoshelham and Elberink 2012
    edge_missing: bool = True  # missing returns at depth edges; paper 1's "realistic depth noise"
    edge_ratio: Positive = 0.1  # jump of inverse depth that is an edge, as a share of the larger one [ours]
    edge_missing_probability: Share = 0.5  # of a missing return at an edge pixel [ours]
    grazing_missing: bool = True  # missing returns at grazing angles
    grazing_angle_deg: Annotated[float, above(0), at_most(90)] = 80.0  # deg between ray and surface normal
    # beyond which nothing returns [ours]
    _scene: Scene = field(init=False, repr=False)
    _rng: np.random.Generator = field(init=False, repr=False)
    _directions: Float32 = field(init=False, repr=False)
    _rays: Float32 = field(init=False, repr=False)
    _offset_m: Float = field(init=False, repr=False)
    _body_from_camera: Float = field(init=False, repr=False)

    def __post_init__(self) -> None:
        require(
            self.min_range_m < self.max_range_m,
            f"min_range_m must be < max_range_m = {self.max_range_m}, got {self.min_range_m}",
        )

    @property
    def focal_px(self) -> float:
        """Focal length of the square pixels, px; the field of view ends at the outer pixel edges."""
        return 0.5 * self.width_px / math.tan(math.radians(0.5 * self.horizontal_fov_deg))

    @property
    def centre_px(self) -> tuple[float, float]:
        """Optical axis, px; pixel (0, 0) has its centre at (0, 0)."""
        return 0.5 * (self.width_px - 1), 0.5 * (self.height_px - 1)

    def reset(self, scene: Scene, rng: np.random.Generator) -> None:
        """Begin a trial in `scene`, drawing noise from `rng`."""
        self._scene, self._rng = scene, rng
        cx, cy = self.centre_px
        u, v = np.meshgrid(np.arange(self.width_px), np.arange(self.height_px))
        # z = 1: the ray parameter is the depth along the optical axis
        grid = np.stack([(u - cx) / self.focal_px, (v - cy) / self.focal_px, np.ones_like(u)], axis=-1)
        self._directions = grid.reshape(-1, 3).astype(np.float32)
        self._rays = np.empty((self._directions.shape[0], 6), dtype=np.float32)
        self._offset_m = np.array(self.mount_offset_m)
        pitch = math.radians(self.mount_pitch_deg)
        forward = np.array([math.cos(pitch), 0.0, math.sin(pitch)])
        down = np.array([math.sin(pitch), 0.0, -math.cos(pitch)])
        self._body_from_camera = np.stack([np.array([0.0, -1.0, 0.0]), down, forward], axis=1)

    def capture(self, true_state: State, estimated_state: State, time_s: float) -> DepthScan:
        """Measure from the true pose; the scan carries the pose believed (estimated)."""
        position, rotation = self._camera_pose(true_state)
        _aim(self._directions, position, rotation, self._rays)
        hit, normal = self._scene.cast(self._rays)
        shape = (self.height_px, self.width_px)
        believed_position, believed_rotation = self._camera_pose(estimated_state)
        unit = self.disparity_focal_px * self.baseline_m / self.disparity_step_px
        depth = _measure(
            hit.reshape(shape),
            normal,
            self._rays,
            self._rng.standard_normal(shape, dtype=np.float32),
            self._rng.random(shape, dtype=np.float32),
            self.min_range_m,
            self.max_range_m,
            1.0 if self.axial_noise else 0.0,
            unit if self.quantisation else 0.0,
            self.edge_ratio,
            self.edge_missing_probability if self.edge_missing else 0.0,
            math.cos(math.radians(self.grazing_angle_deg)) if self.grazing_missing else 0.0,
        )
        return DepthScan(
            time_s=time_s,
            depth_m=depth,
            focal_px=(self.focal_px, self.focal_px),
            centre_px=self.centre_px,
            max_range_m=self.max_range_m,
            camera_position_m=believed_position,
            camera_rotation=believed_rotation,
        )

    def _camera_pose(self, state: State) -> tuple[Float, Float]:
        """World position (3,) and camera-to-world rotation (3, 3) of the camera."""
        body = rotation_from_quaternion(state.quaternion_wxyz)
        return state.position_m + body @ self._offset_m, body @ self._body_from_camera

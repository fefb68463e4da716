"""A depth camera: the true image (`true_depth`) with a structured-light sensor's noise (`depth_noise`).

What maps (`sensor=rgbd`) and what inspects (`mission.seen_by=image`) are both one. Every term of the
noise has its switch. One normal and one uniform number is drawn per pixel and frame
whatever the image and the switches, so that streams stay aligned.
Left out: lateral noise, lens distortion, interference, motion blur, colour.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Annotated

import numpy as np

from uavexp.arrays import Float
from uavexp.errors import require
from uavexp.geometry import rotation_from_quaternion
from uavexp.parameters import NonNegative, Positive, Share, Vector, above, at_most, between
from uavexp.scan import DepthScan
from uavexp.scene import Scene
from uavexp.sensor.depth_noise import DepthNoise, measure
from uavexp.sensor.true_depth import TrueDepth
from uavexp.types import State

Pixels = Annotated[int, between(2, 4096)]


@dataclass(slots=True, kw_only=True)
class DepthCamera:
    """Looks along the body's x axis, turned by its mount; values are checked by the option that is one."""

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
    axial_noise_scale: NonNegative = 1.0  # times that sigma [ours]
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
    _rng: np.random.Generator = field(init=False, repr=False)
    _image: TrueDepth = field(init=False, repr=False)
    _noise: DepthNoise = field(init=False, repr=False)
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

    @property
    def noise(self) -> DepthNoise:
        """The switches and values of the noise as its kernel takes them."""
        unit_m = self.disparity_focal_px * self.baseline_m / self.disparity_step_px
        cosine = math.cos(math.radians(self.grazing_angle_deg))
        return DepthNoise(
            min_range_m=np.float32(self.min_range_m),
            max_range_m=np.float32(self.max_range_m),
            axial=np.float32(self.axial_noise_scale if self.axial_noise else 0.0),
            disparity_unit_m=np.float32(unit_m if self.quantisation else 0.0),
            edge_ratio=np.float32(self.edge_ratio),
            edge_probability=np.float32(self.edge_missing_probability if self.edge_missing else 0.0),
            least_cosine=np.float32(cosine if self.grazing_missing else 0.0),
        )

    def reset(self, scene: Scene, rng: np.random.Generator) -> None:
        """Begin a trial in `scene`, drawing noise from `rng`."""
        intrinsics = np.array([self.focal_px, self.focal_px, *self.centre_px])
        self._rng, self._image = rng, TrueDepth(scene, (self.height_px, self.width_px), intrinsics)
        self._noise = self.noise
        self._offset_m = np.array(self.mount_offset_m)
        pitch = math.radians(self.mount_pitch_deg)
        forward = np.array([math.cos(pitch), 0.0, math.sin(pitch)])
        down = np.array([math.sin(pitch), 0.0, -math.cos(pitch)])
        self._body_from_camera = np.stack([np.array([0.0, -1.0, 0.0]), down, forward], axis=1)

    def capture(self, true_state: State, estimated_state: State, time_s: float) -> DepthScan:
        """Measure from the true pose; the scan carries the pose believed (estimated)."""
        image = self._image
        image.take(*self._camera_pose(true_state))
        gaussian = self._rng.standard_normal(image.inverse.shape, dtype=np.float32)
        uniform = self._rng.random(image.inverse.shape, dtype=np.float32)
        depth_m = measure(image.inverse, image.plane_m, image.slant, gaussian, uniform, self._noise)
        believed_position, believed_rotation = self._camera_pose(estimated_state)
        return DepthScan(
            time_s=time_s,
            depth_m=depth_m,
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

"""What the inspecting camera sees of the building as it is: by ideal rays, or in a depth image.

`rays`: every cell within range, incidence and a level image about the vehicle's yaw, to which the line of
sight is free in truth; five times a second. `image`: every cell that a depth image shows (`imaged_cells`),
taken with the vehicle's true attitude by a camera with the noise, frame rate and least range of
`sensor=rgbd`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Protocol

import numpy as np

from uavexp.arrays import Bool, Float, Int, Int32
from uavexp.geometry import yaw_of
from uavexp.inspection.reference_surface import Surface
from uavexp.inspection.visibility import Camera, Grid, visible_cells
from uavexp.mission.imaged_cells import Frame, imaged_cells
from uavexp.scene import Scene
from uavexp.sensor.depth_camera import DepthCamera
from uavexp.types import State

_NOTHING = Grid(np.zeros((1, 1, 1), dtype=np.uint8), np.zeros(3), 1e3)  # blocks no sight
_RAYS_S = 0.2  # between the instants at which ideal rays earn coverage


class SeenBy(StrEnum):
    """What a cell must be met by to count as seen."""

    RAYS = "rays"
    IMAGE = "image"


class Eye(Protocol):
    """Looks now and then, and says what it saw last."""

    @property
    def period_s(self) -> float:
        """Time from one look to the next."""

    def look(self, position_m: Float, quaternion_wxyz: Float, time_s: float) -> None:
        """Look from a true pose; movers stand where they are now."""

    def sees(self, surface: Surface, sought: Bool) -> Int | Int32:
        """Of the cells (N,) looked for, those seen in the last look, ascending."""


@dataclass(slots=True, kw_only=True)
class RayEye:
    """Ideal rays into the true geometry.

    Attributes:
        scene: the truth.
        camera: that looks, level.
        tolerance_m: a cell counts as seen when the true surface met on the line of sight lies
            within this of the cell, along the cell's normal.
        period_s: from one look to the next.
    """

    scene: Scene
    camera: Camera
    tolerance_m: float
    period_s: float = _RAYS_S
    _eye_m: Float = field(init=False, repr=False)
    _yaw_rad: float = field(init=False, repr=False)

    def look(self, position_m: Float, quaternion_wxyz: Float, time_s: float) -> None:
        """Look from a true pose; movers stand where they are now."""
        self._eye_m, self._yaw_rad = position_m, yaw_of(quaternion_wxyz)

    def sees(self, surface: Surface, sought: Bool) -> Int:
        """Of the cells (N,) looked for, those that rays meet, ascending."""
        point, normal, optics = surface.point_m, surface.normal, self.camera.optics
        framed = visible_cells(_NOTHING, optics, self._eye_m, self._yaw_rad, point, normal, sought)
        met = is_met(self.scene, self._eye_m, point[framed], normal[framed], self.tolerance_m)
        return np.asarray(framed[met])


@dataclass(slots=True, kw_only=True)
class ImageEye:
    """A depth camera on the vehicle.

    Attributes:
        lens: takes the images, in a scene (`DepthCamera.reset`).
        camera: range and incidence within which a cell counts.
        tolerance_m: beyond what the noise may add, between a cell and the surface measured there.
    """

    lens: DepthCamera
    camera: Camera
    tolerance_m: float
    _frame: Frame = field(init=False, repr=False)

    @property
    def period_s(self) -> float:
        """From one frame to the next."""
        return 1.0 / self.lens.rate_hz

    def look(self, position_m: Float, quaternion_wxyz: Float, time_s: float) -> None:
        """Take an image from a true pose; movers stand where they are now."""
        at_rest = np.zeros(3)  # a frame is taken in an instant
        pose = State(
            position_m=position_m, velocity_mps=at_rest, quaternion_wxyz=quaternion_wxyz,
            body_rate_radps=at_rest,
        )  # fmt: skip
        scan = self.lens.capture(pose, pose, time_s)
        self._frame = Frame(
            scan.depth_m, *scan.focal_px, *scan.centre_px, scan.camera_position_m, scan.camera_rotation
        )

    def sees(self, surface: Surface, sought: Bool) -> Int32:
        """Of the cells (N,) looked for, those that the last image shows, ascending."""
        found = imaged_cells(
            self._frame, self.camera.optics, self.lens.noise, self.tolerance_m,
            surface.point_m, surface.normal, sought,
        )  # fmt: skip
        return np.asarray(found)


def lens_of(camera: Camera, width_px: int) -> DepthCamera:
    """The depth camera with an inspecting camera's angles and range, and so many square pixels a row."""
    across, down = (math.tan(0.5 * fov) for fov in (camera.horizontal_fov_rad, camera.vertical_fov_rad))
    return DepthCamera(
        width_px=width_px,
        height_px=max(2, round(width_px * down / across)),
        horizontal_fov_deg=math.degrees(camera.horizontal_fov_rad),
        min_range_m=camera.min_range_m,
        max_range_m=camera.max_range_m,
    )


def is_met(scene: Scene, eye_m: Float, point_m: Float, normal: Float, tolerance_m: float) -> Bool:
    """Whether lines of sight end at the cells (N,): the true surface is there and nothing is before it.

    Args:
        scene: the truth.
        eye_m: (3,).
        point_m: of the cells (N, 3).
        normal: of the cells (N, 3).
        tolerance_m: between cell and true surface, along the normal.
    """
    line = point_m - eye_m
    length = np.linalg.norm(line, axis=1)
    way = line / length[:, None]
    eyes = np.broadcast_to(eye_m, way.shape)
    hit = scene.cast(np.hstack([eyes, way]).astype(np.float32))[0].astype(np.float64)
    return np.asarray(np.abs(hit - length) * -(way * normal).sum(axis=1) <= tolerance_m)

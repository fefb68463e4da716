"""A recording of depth images with the poses of their camera, whatever it was read from."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from uavexp.arrays import Float, Float32
from uavexp.errors import ConfigError, RecordError
from uavexp.scan import DepthScan

BODY_FROM_CAMERA = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])


@dataclass(frozen=True, slots=True, kw_only=True)
class Reading:
    """What the files do not say."""

    rate_hz: float = 30.0  # of numbered frames
    unit_m: float | None = None  # of a depth value; None: as the form has it
    stride: int = 4  # every so many pixels along both axes
    up: tuple[float, float, float] = (0.0, 0.0, 1.0)  # the recording's axis that points up
    images: str | None = None  # a bag's topic of depth images; None: the only one
    poses: str | None = None  # a bag's topic of the vehicle's poses; None: as `uavexp.judge` finds it
    mount_m: tuple[float, float, float] = (0.0, 0.0, 0.0)  # of the camera on the vehicle: forward, left, up
    mount_pitch_rad: float = 0.0  # of its axis above the vehicle's


@dataclass(frozen=True, slots=True, kw_only=True)
class Frame:
    """One image and the pose of its camera."""

    time_s: float
    position_m: Float  # (3,)
    rotation: Float  # (3, 3) camera to world
    depth_m: Callable[[], Float32]  # (H, W) along the optical axis; NaN: not measured

    @property
    def body_rotation(self) -> Float:
        """Body (forward, left, up) to world of a body that looks as the camera does (3, 3)."""
        return np.asarray(self.rotation @ BODY_FROM_CAMERA.T)


@dataclass(frozen=True, slots=True, kw_only=True)
class Recorded:
    """A recording, z up, time from its first image on."""

    path: Path
    frames: tuple[Frame, ...]  # at least 2, by time
    camera: Float  # (3, 3) of the images as `Frame.depth_m` gives them
    notes: tuple[str, ...]

    def scan(self, frame: Frame, max_range_m: float) -> DepthScan:
        """The image of a frame as the map takes it; what is farther was measured to lie beyond.

        Raises:
            RecordError: it is no depth image, or damaged.
        """
        depth_m = frame.depth_m()
        return DepthScan(
            time_s=frame.time_s,
            depth_m=np.where(depth_m > max_range_m, np.inf, depth_m).astype(np.float32),
            focal_px=(self.camera[0, 0], self.camera[1, 1]),
            centre_px=(self.camera[0, 2], self.camera[1, 2]),
            max_range_m=max_range_m,
            camera_position_m=frame.position_m,
            camera_rotation=frame.rotation,
        )


def recorded_of(
    path: Path, frames: list[Frame], camera: Float, reading: Reading, notes: tuple[str, ...]
) -> Recorded:
    """Frames of the recording's own frame and clock, and the camera of whole images, as a recording.

    Raises:
        RecordError: fewer than two frames.
        ConfigError: `up` is no direction.
    """
    if len(frames) < 2:
        raise RecordError(f"{path}: {len(frames)} depth images with a pose, at least 2 are needed")
    begin_s, turn, step = frames[0].time_s, _upright(reading.up), reading.stride
    thinned = np.array(camera, dtype=np.float64)
    thinned[:2, 2] -= step // 2
    thinned[:2] /= step
    return Recorded(
        path=path,
        frames=tuple(
            Frame(
                time_s=frame.time_s - begin_s,
                position_m=turn @ frame.position_m,
                rotation=turn @ frame.rotation,
                depth_m=frame.depth_m,
            )
            for frame in frames
        ),
        camera=thinned,
        notes=notes,
    )


def thinned(pixels: Float32, stride: int) -> Float32:
    """Every so many pixels along both axes, from the middle of the first so many on."""
    return pixels[stride // 2 :: stride, stride // 2 :: stride]


def _upright(up: tuple[float, float, float]) -> Float:
    """The least rotation (3, 3) that turns a direction to +z."""
    length = float(np.linalg.norm(up))
    if not length > 0.0:
        raise ConfigError(f"--up must be a direction, got {' '.join(map(str, up))}")
    turn, _ = Rotation.align_vectors([[0.0, 0.0, 1.0]], [np.array(up) / length])
    return np.asarray(turn.as_matrix())

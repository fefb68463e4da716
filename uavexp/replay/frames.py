"""Recorded depth images with the poses of their camera, in the two forms of a folder.

Numbered, as 7-Scenes is handed on: `intrinsics.txt` (3 x 3), `poses.txt` (frame number and the
camera-to-world matrix, 3 x 4, by row), `NNNNNN.depth.png` in mm. TUM's RGB-D benchmark (Sturm et al. 2012):
`depth.txt` (stamp and file), `groundtruth.txt` (stamp tx ty tz qx qy qz qw), depth in 1/5000 m, and an
`intrinsics.txt` as above, which TUM has on its page only. Camera frame: x right, y down, z forward.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from PIL import Image, UnidentifiedImageError
from scipy.spatial.transform import Rotation

from uavexp.arrays import Float, Float32
from uavexp.errors import ConfigError, RecordError
from uavexp.scan import DepthScan

INTRINSICS, POSES, DEPTH, TRUTH = "intrinsics.txt", "poses.txt", "depth.txt", "groundtruth.txt"
_NOT_MEASURED = (0, 65535)
_SAME_S = 0.02  # a pose this near an image is its pose, as TUM's own tools have it
_ROTATION_IS = 0.02  # printed digits are few, but a matrix farther from a rotation is none
_BODY_FROM_CAMERA = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])


@dataclass(frozen=True, slots=True, kw_only=True)
class Reading:
    """What the files do not say."""

    rate_hz: float = 30.0  # of numbered frames
    unit_m: float | None = None  # of a depth value; None: 0.001 of ours, 0.0002 of TUM's
    stride: int = 4  # every so many pixels along both axes
    up: tuple[float, float, float] = (0.0, 0.0, 1.0)  # the recording's axis that points up


@dataclass(frozen=True, slots=True, kw_only=True)
class Frame:
    """One image and the pose of its camera, z up."""

    time_s: float  # since the first
    file: Path
    position_m: Float  # (3,)
    rotation: Float  # (3, 3) camera to world

    @property
    def body_rotation(self) -> Float:
        """Body (forward, left, up) to world of a body that looks as the camera does (3, 3)."""
        return np.asarray(self.rotation @ _BODY_FROM_CAMERA.T)


@dataclass(frozen=True, slots=True, kw_only=True)
class Recorded:
    """A recording: its images are read when asked for."""

    folder: Path
    frames: tuple[Frame, ...]  # at least 2, by time
    camera: Float  # (3, 3)
    unit_m: float
    stride: int
    notes: tuple[str, ...]

    def scan(self, frame: Frame, max_range_m: float) -> DepthScan:
        """The image of a frame as the map takes it; what is farther was measured to lie beyond.

        Raises:
            RecordError: it is no depth image, or damaged.
        """
        step = self.stride
        raw = _image(frame.file)[step // 2 :: step, step // 2 :: step]
        depth_m = np.where(np.isin(raw, _NOT_MEASURED), np.nan, raw * self.unit_m)
        cx, cy = ((self.camera[axis, 2] - step // 2) / step for axis in (0, 1))
        return DepthScan(
            time_s=frame.time_s,
            depth_m=np.where(depth_m > max_range_m, np.inf, depth_m).astype(np.float32),
            focal_px=(self.camera[0, 0] / step, self.camera[1, 1] / step),
            centre_px=(cx, cy),
            max_range_m=max_range_m,
            camera_position_m=frame.position_m,
            camera_rotation=frame.rotation,
        )


def read(folder: Path, reading: Reading) -> Recorded:
    """Read a recording's poses and what its images are.

    Raises:
        RecordError: a file is missing or damaged, or the recording is no sequence.
        ConfigError: `up` is no direction.
    """
    if not folder.is_dir():
        raise RecordError(f"{folder}: there is no such folder of depth images")
    if (folder / POSES).is_file():
        found, unit_m = _numbered(folder, reading.rate_hz), 0.001
    elif (folder / DEPTH).is_file() and (folder / TRUTH).is_file():
        found, unit_m = _tum(folder), 0.0002
    else:
        raise RecordError(f"{folder} holds neither {POSES} nor TUM's {DEPTH} and {TRUTH}")
    rows, notes = found
    if len(rows) < 2:
        raise RecordError(f"{folder}: {len(rows)} depth images with a pose, at least 2 are needed")
    begin_s = rows[0][0]
    turn = _upright(reading.up)
    return Recorded(
        folder=folder,
        frames=tuple(
            Frame(time_s=time_s - begin_s, file=file, position_m=turn @ position, rotation=turn @ rotation)
            for time_s, file, position, rotation in rows
        ),
        camera=_camera(folder),
        unit_m=reading.unit_m or unit_m,
        stride=reading.stride,
        notes=notes,
    )


_Rows = tuple[
    list[tuple[float, Path, Float, Float]], tuple[str, ...]
]  # time, image, position, rotation; notes


def _numbered(folder: Path, rate_hz: float) -> _Rows:
    table = _table(folder / POSES, 13)
    _check_order(folder / POSES, table[:, 0], "frame")
    rows, lacking = [], 0
    for row in table:
        file = folder / f"{int(row[0]):06d}.depth.png"
        pose = row[1:].reshape(3, 4)
        if file.is_file():
            rows.append((float(row[0]) / rate_hz, file, pose[:, 3], _rotation(folder / POSES, pose[:, :3])))
        lacking += not file.is_file()
    notes = (f"{lacking} poses have no depth image",) if lacking else ()
    return rows, (f"frames are numbered: taken for {rate_hz:g} a second (--rate)", *notes)


def _tum(folder: Path) -> _Rows:
    poses = _table(folder / TRUTH, 8)
    _check_order(folder / TRUTH, poses[:, 0], "stamp")
    images = [words for words in _lines(folder / DEPTH) if len(words) >= 2]
    try:
        stamps = np.array([words[0] for words in images], dtype=np.float64)
    except ValueError as error:
        raise RecordError(f"{folder / DEPTH}: {error}") from error
    _check_order(folder / DEPTH, stamps, "stamp")
    rows, alone = [], 0
    for time_s, words in zip(stamps.tolist(), images, strict=True):
        nearest = int(np.abs(poses[:, 0] - time_s).argmin())
        if abs(float(poses[nearest, 0]) - time_s) > _SAME_S:
            alone += 1
            continue
        rotation = _of_quaternion(folder / TRUTH, poses[nearest, 4:])
        rows.append((time_s, folder / words[1], poses[nearest, 1:4], rotation))
    return rows, (f"{alone} images have no pose within {_SAME_S:g} s and are left out",) if alone else ()


def _lines(file: Path) -> list[list[str]]:
    try:
        text = file.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise RecordError(f"{file}: cannot be read ({error})") from error
    return [line.split() for line in text.splitlines() if line.strip() and not line.startswith("#")]


def _table(file: Path, columns: int) -> Float:
    """Rows of so many numbers."""
    rows = _lines(file)
    for number, row in enumerate(rows):
        if len(row) != columns:
            raise RecordError(f"{file}: row {number} has {len(row)} numbers, {columns} are needed")
    try:
        table = np.array(rows, dtype=np.float64).reshape(-1, columns)
    except ValueError as error:
        raise RecordError(f"{file}: {error}") from error
    if not np.isfinite(table).all():
        raise RecordError(f"{file}: row {int((~np.isfinite(table)).any(axis=1).argmax())} is not finite")
    return table


def _check_order(file: Path, order: Float, what: str) -> None:
    back = np.diff(order) <= 0.0
    if back.any():
        n = int(back.argmax()) + 1
        raise RecordError(
            f"{file}: each {what} must be later than the one before, row {n} has {order[n]:.6g}"
        )


def _rotation(file: Path, matrix: Float) -> Float:
    """The rotation nearest to a matrix (3, 3)."""
    left, stretch, right = np.linalg.svd(matrix)
    rotation = left @ right
    if np.abs(stretch - 1.0).max() > _ROTATION_IS or np.linalg.det(rotation) < 0.0:
        raise RecordError(f"{file}: a pose is no rotation (singular values {np.round(stretch, 3).tolist()})")
    return np.asarray(rotation)


def _of_quaternion(file: Path, xyzw: Float) -> Float:
    if abs(float(np.linalg.norm(xyzw)) - 1.0) > _ROTATION_IS:
        raise RecordError(f"{file}: a quaternion has length {np.linalg.norm(xyzw):.3f}, not 1")
    return np.asarray(Rotation.from_quat(xyzw).as_matrix())


def _camera(folder: Path) -> Float:
    camera = _table(folder / INTRINSICS, 3)
    if camera.shape != (3, 3) or min(camera[0, 0], camera[1, 1]) <= 0.0:
        raise RecordError(f"{folder / INTRINSICS}: three rows fx 0 cx, 0 fy cy, 0 0 1 are needed, in pixels")
    return camera


def _upright(up: tuple[float, float, float]) -> Float:
    """The least rotation (3, 3) that turns a direction to +z."""
    length = float(np.linalg.norm(up))
    if not length > 0.0:
        raise ConfigError(f"--up must be a direction, got {' '.join(map(str, up))}")
    turn, _ = Rotation.align_vectors([[0.0, 0.0, 1.0]], [np.array(up) / length])
    return np.asarray(turn.as_matrix())


def _image(file: Path) -> Float32:
    try:
        with Image.open(file) as image:
            pixels = np.asarray(image)
    except (OSError, UnidentifiedImageError, ValueError, SyntaxError) as error:
        raise RecordError(f"{file}: no depth image, or damaged ({error})") from error
    if pixels.ndim != 2:
        raise RecordError(f"{file}: a depth image has one channel, this one is {pixels.shape}")
    return pixels.astype(np.float32)

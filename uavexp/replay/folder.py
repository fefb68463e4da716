"""Recorded depth images with the poses of their camera, in the two forms of a folder.

Numbered, as 7-Scenes is handed on: `intrinsics.txt` (3 x 3), `poses.txt` (frame number and the
camera-to-world matrix, 3 x 4, by row), `NNNNNN.depth.png` in mm. TUM's RGB-D benchmark (Sturm et al. 2012):
`depth.txt` (stamp and file), `groundtruth.txt` (stamp tx ty tz qx qy qz qw), depth in 1/5000 m, and an
`intrinsics.txt` as above, which TUM has on its page only. Camera frame: x right, y down, z forward.
"""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
from PIL import Image, UnidentifiedImageError
from scipy.spatial.transform import Rotation

from uavexp.arrays import Float, Float32
from uavexp.errors import RecordError
from uavexp.replay.recorded import Frame, Reading, Recorded, recorded_of, thinned

INTRINSICS, POSES, DEPTH, TRUTH = "intrinsics.txt", "poses.txt", "depth.txt", "groundtruth.txt"
_UNIT_M, _TUMS_UNIT_M = 0.001, 0.0002
_NOT_MEASURED = (0, 65535)
_SAME_S = 0.02  # a pose this near an image is its pose, as TUM's own tools have it
_ROTATION_IS = 0.02  # printed digits are few, but a matrix farther from a rotation is none


def read(folder: Path, reading: Reading) -> Recorded:
    """Read a recording's poses and what its images are.

    Raises:
        RecordError: a file is missing or damaged, or the recording is no sequence.
        ConfigError: `up` is no direction.
    """
    if (folder / POSES).is_file():
        frames, notes = _numbered(folder, reading)
    elif (folder / DEPTH).is_file() and (folder / TRUTH).is_file():
        frames, notes = _tum(folder, reading)
    else:
        raise RecordError(f"{folder} holds neither {POSES} nor TUM's {DEPTH} and {TRUTH}")
    return recorded_of(folder, frames, _camera(folder), reading, notes)


def _numbered(folder: Path, reading: Reading) -> tuple[list[Frame], tuple[str, ...]]:
    table = _table(folder / POSES, 13)
    _check_order(folder / POSES, table[:, 0], "frame")
    depth_m = partial(_depth_m, unit_m=reading.unit_m or _UNIT_M, stride=reading.stride)
    frames, lacking = [], 0
    for row in table:
        file = folder / f"{int(row[0]):06d}.depth.png"
        pose = row[1:].reshape(3, 4)
        if file.is_file():
            rotation = _rotation(folder / POSES, pose[:, :3])
            frame = Frame(
                time_s=float(row[0]) / reading.rate_hz,
                position_m=pose[:, 3],
                rotation=rotation,
                depth_m=partial(depth_m, file),
            )
            frames.append(frame)
        lacking += not file.is_file()
    notes = (f"{lacking} poses have no depth image",) if lacking else ()
    return frames, (f"frames are numbered: taken for {reading.rate_hz:g} a second (--rate)", *notes)


def _tum(folder: Path, reading: Reading) -> tuple[list[Frame], tuple[str, ...]]:
    poses = _table(folder / TRUTH, 8)
    _check_order(folder / TRUTH, poses[:, 0], "stamp")
    images = [words for words in _lines(folder / DEPTH) if len(words) >= 2]
    try:
        stamps = np.array([words[0] for words in images], dtype=np.float64)
    except ValueError as error:
        raise RecordError(f"{folder / DEPTH}: {error}") from error
    _check_order(folder / DEPTH, stamps, "stamp")
    depth_m = partial(_depth_m, unit_m=reading.unit_m or _TUMS_UNIT_M, stride=reading.stride)
    frames, alone = [], 0
    for time_s, words in zip(stamps.tolist(), images, strict=True):
        nearest = int(np.abs(poses[:, 0] - time_s).argmin())
        if abs(float(poses[nearest, 0]) - time_s) > _SAME_S:
            alone += 1
            continue
        rotation = _of_quaternion(folder / TRUTH, poses[nearest, 4:])
        frame = Frame(
            time_s=time_s,
            position_m=poses[nearest, 1:4],
            rotation=rotation,
            depth_m=partial(depth_m, folder / words[1]),
        )
        frames.append(frame)
    return frames, (f"{alone} images have no pose within {_SAME_S:g} s and are left out",) if alone else ()


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


def _depth_m(file: Path, unit_m: float, stride: int) -> Float32:
    """The image of a file, thinned; NaN where it was not measured."""
    try:
        with Image.open(file) as image:
            pixels = np.asarray(image)
    except (OSError, UnidentifiedImageError, ValueError, SyntaxError) as error:
        raise RecordError(f"{file}: no depth image, or damaged ({error})") from error
    if pixels.ndim != 2:
        raise RecordError(f"{file}: a depth image has one channel, this one is {pixels.shape}")
    raw = thinned(pixels, stride)
    return np.where(np.isin(raw, _NOT_MEASURED), np.nan, raw * unit_m).astype(np.float32)

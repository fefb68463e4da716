"""Depth images of a ROS bag, raw, with their camera_info; the vehicle's poses as `uavexp.judge` reads them.

Images are `16UC1` in mm or `32FC1` in m; compressed ones are not read. The camera stands on the vehicle as
the reading says (`mount_m`, `mount_pitch_rad`).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore
from scipy.spatial.transform import Rotation, Slerp

from uavexp.arrays import Float, Float32
from uavexp.errors import ConfigError, RecordError
from uavexp.judge import readers
from uavexp.judge.recording import Track, at
from uavexp.judge.rosbag import messages_of, stamps_s
from uavexp.replay.recorded import BODY_FROM_CAMERA, Frame, Reading, Recorded, recorded_of, thinned

_IMAGE, _CAMERA = "sensor_msgs/msg/Image", "sensor_msgs/msg/CameraInfo"
_ENCODINGS = {"16UC1": ("u2", 0.001), "mono16": ("u2", 0.001), "32FC1": ("f4", 1.0)}  # type, unit m
_NEAR_S = 0.1  # an image farther from any pose than this has none


def read(path: Path, reading: Reading) -> Recorded:
    """Read a bag's depth images, which are kept in memory as they are thinned.

    Raises:
        RecordError: it has no depth images, no intrinsics of theirs, or no orientation of the vehicle.
        ConfigError: several topics might be meant.
    """
    poses = readers.read(path, reading.poses)
    if poses.quaternion_wxyz is None:
        raise RecordError(f"{path}: {poses.source} tells no orientation; name another with --poses")
    with AnyReader([path], default_typestore=get_typestore(Stores.ROS2_HUMBLE)) as bag:
        kinds = {connection.topic: connection.msgtype for connection in bag.connections}
        topic = _topic(path, kinds, reading.images)
        camera = _intrinsics(path, bag, kinds, topic)
        stamped = [
            (time_ns, message.header, _depth_m(path, message, reading))
            for time_ns, message in messages_of(bag, topic)
        ]
    times_s = stamps_s([(time_ns, _Headed(header)) for time_ns, header, _ in stamped])
    if (np.diff(times_s) <= 0.0).any():
        raise RecordError(f"{path}: stamps of {topic} must increase")
    track = poses.position_m
    near = np.array([np.abs(track.time_s - time_s).min() <= _NEAR_S for time_s in times_s], dtype=np.bool_)
    rotations = _rotations(poses.quaternion_wxyz, times_s)
    pitch = Rotation.from_euler("y", -reading.mount_pitch_rad).as_matrix()
    frames = [
        Frame(
            time_s=time_s,
            position_m=place_m + rotation @ np.array(reading.mount_m),
            rotation=rotation @ pitch @ BODY_FROM_CAMERA,
            depth_m=lambda depth_m=depth_m: depth_m,  # type: ignore[misc]
        )
        for time_s, place_m, rotation, (_, _, depth_m), has_pose in zip(
            times_s.tolist(), at(track, times_s), rotations, stamped, near, strict=True
        )
        if has_pose
    ]
    alone = int(np.count_nonzero(~near))
    notes = (f"{alone} images have no pose within {_NEAR_S:g} s and are left out",) if alone else ()
    return recorded_of(path, frames, camera, reading, (*poses.notes, *notes))


class _Headed:
    """A message of which the header alone was kept."""

    def __init__(self, header: Any) -> None:
        self.header = header


def _topic(path: Path, kinds: Mapping[str, str], asked: str | None) -> str:
    images = sorted(topic for topic, kind in kinds.items() if kind == _IMAGE)
    if asked is not None:
        if asked not in images:
            raise ConfigError(f"{path}: {asked} tells no images; there are {', '.join(images) or 'none'}")
        return asked
    depth = [topic for topic in images if "depth" in topic] or images
    if len(depth) > 1:
        raise ConfigError(f"{path}: {', '.join(depth)} tell images; name one with --images")
    if not depth:
        raise RecordError(f"{path}: no topic of {_IMAGE}; compressed images are not read")
    return depth[0]


def _intrinsics(path: Path, bag: AnyReader, kinds: Mapping[str, str], topic: str) -> Float:
    """The matrix (3, 3) of the camera_info beside the images, else of the only one."""
    infos = sorted(name for name, kind in kinds.items() if kind == _CAMERA)
    beside = [name for name in infos if name.rpartition("/")[0] == topic.rpartition("/")[0]] or infos
    if len(beside) != 1:
        raise RecordError(f"{path}: {len(beside)} topics of {_CAMERA} for {topic}, one is needed")
    for _, message in messages_of(bag, beside[0]):
        camera = np.asarray(message.k if hasattr(message, "k") else message.K, dtype=np.float64).reshape(3, 3)
        if camera[0, 0] > 0.0 and camera[1, 1] > 0.0:
            return camera
    raise RecordError(f"{path}: {beside[0]} tells no focal length")


def _depth_m(path: Path, message: Any, reading: Reading) -> Float32:
    if message.encoding not in _ENCODINGS:
        known = ", ".join(_ENCODINGS)
        raise RecordError(f"{path}: images are {message.encoding}, depth is one of {known}; see --images")
    kind, unit_m = _ENCODINGS[message.encoding]
    order = ">" if message.is_bigendian else "<"
    rows = np.asarray(message.data, dtype=np.uint8).reshape(message.height, message.step)
    pixels = rows[:, : message.width * int(kind[1])].copy().view(order + kind)
    raw = thinned(pixels.astype(np.float32), reading.stride)
    return np.where(np.isfinite(raw) & (raw > 0.0), raw * (reading.unit_m or unit_m), math.nan).astype(
        np.float32
    )


def _rotations(track: Track, times_s: Float) -> Float:
    """Body to world (N, 3, 3) at times (N,), turned evenly between samples."""
    turned = Rotation.from_quat(track.values[:, [1, 2, 3, 0]])
    clock_s, unique = np.unique(track.time_s, return_index=True)
    if len(clock_s) < 2:
        return np.tile(turned[0].as_matrix(), (len(times_s), 1, 1))
    return np.asarray(Slerp(clock_s, turned[unique])(np.clip(times_s, clock_s[0], clock_s[-1])).as_matrix())

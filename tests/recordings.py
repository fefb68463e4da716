"""Recordings of one flight that can be computed by hand, in every format that is judged."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest

RADIUS_M, SPEED_MPS, HEIGHT_M, CENTRE_M = 2.0, 1.0, 1.5, (5.0, 4.0)
STEP_S, SAMPLES = 0.02, 501
ROOM_M = (10.0, 8.0, 3.0)  # from the origin


def circle(step_s: float = STEP_S, samples: int = SAMPLES) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Times (N,), positions and velocities (N, 3) of a flight on a level circle."""
    time_s = step_s * np.arange(samples)
    angle = SPEED_MPS / RADIUS_M * time_s
    outward = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(samples)])
    along = np.column_stack([-np.sin(angle), np.cos(angle), np.zeros(samples)])
    return time_s, np.array([*CENTRE_M, HEIGHT_M]) + RADIUS_M * outward, SPEED_MPS * along


def room_stl(file: Path) -> Path:
    """An empty room as a text STL."""
    trimesh = pytest.importorskip("trimesh")

    box = trimesh.creation.box(bounds=[np.zeros(3), np.array(ROOM_M)])
    box.invert()  # its walls look inwards
    box.export(file)
    return file


def csv_text(time_s: np.ndarray, position_m: np.ndarray, header: str = "time_s,x,y,z") -> str:
    """A table."""
    rows = [",".join(map(repr, row)) for row in np.column_stack([time_s, position_m]).tolist()]
    return "\n".join([header, *rows]) + "\n"


def ulog_bytes(
    time_s: np.ndarray,
    position_m: np.ndarray,
    velocity_mps: np.ndarray,
    *,
    valid: bool = True,
    name: str = "vehicle_local_position",
) -> bytes:
    """A PX4 log of one topic, by the format's own description (docs.px4.io, ULog File Format)."""
    fields = (
        "uint64_t timestamp;float x;float y;float z;float vx;float vy;float vz;bool xy_valid;bool z_valid;"
    )

    def record(kind: bytes, body: bytes) -> bytes:
        return struct.pack("<H", len(body)) + kind + body

    parts = [b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 0)]
    parts.append(record(b"B", bytes(40)))
    parts.append(record(b"F", f"{name}:{fields}".encode()))
    parts.append(record(b"A", struct.pack("<BH", 0, 0) + name.encode()))
    for time, (x, y, z), (vx, vy, vz) in zip(time_s, position_m, velocity_mps, strict=True):
        row = struct.pack("<Q6f2?", round(time * 1e6) + 1_000_000, y, x, -z, vy, vx, -vz, valid, valid)
        parts.append(record(b"D", struct.pack("<H", 0) + row))
    return b"".join(parts)


def ros_bag(
    file: Path, kind: str, time_s: np.ndarray, position_m: np.ndarray, topics: tuple[str, ...] = ("/pose",)
):
    """A bag of PoseStamped: `bag` (ROS 1), `mcap` or `db3` (ROS 2, a folder)."""
    pytest.importorskip("rosbags")
    from rosbags.rosbag1 import Writer as Writer1
    from rosbags.rosbag2 import StoragePlugin
    from rosbags.rosbag2 import Writer as Writer2
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC if kind == "bag" else Stores.ROS2_HUMBLE)
    packages = ("std_msgs", "geometry_msgs", "builtin_interfaces")  # the last one's Time counts
    types = {
        name.rsplit("/", 1)[1]: store.types[name]
        for package in packages
        for name in store.types
        if name.startswith(f"{package}/")
    }
    sequence = {"seq": 0} if kind == "bag" else {}
    plugin = StoragePlugin.MCAP if kind == "mcap" else StoragePlugin.SQLITE3
    with Writer1(file) if kind == "bag" else Writer2(file, version=8, storage_plugin=plugin) as bag:
        name = "geometry_msgs/msg/PoseStamped"
        connections = [bag.add_connection(topic, name, typestore=store) for topic in topics]
        for number, (time, place) in enumerate(zip(time_s.tolist(), position_m.tolist(), strict=True)):
            second, nanosecond = divmod(round(time * 1e9) + 5_000_000_000, 1_000_000_000)
            header = types["Header"](
                stamp=types["Time"](sec=second, nanosec=nanosecond), frame_id="map", **sequence
            )
            pose = types["Pose"](
                position=types["Point"](*place), orientation=types["Quaternion"](x=0.0, y=0.0, z=0.0, w=1.0)
            )
            message = types["PoseStamped"](header=header, pose=pose)
            data = (
                store.serialize_ros1(message, name) if kind == "bag" else store.serialize_cdr(message, name)
            )
            for connection in connections:
                bag.write(connection, number * 20_000_000, data)
    return file


def depth_bag(
    file: Path, kind: str, encoding: str, images, camera: np.ndarray, places_m, step_s: float
) -> Path:
    """A bag of depth images in mm or m, their camera_info, and odometry of a vehicle that looks along x."""
    pytest.importorskip("rosbags")
    from rosbags.rosbag1 import Writer as Writer1
    from rosbags.rosbag2 import StoragePlugin
    from rosbags.rosbag2 import Writer as Writer2
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC if kind == "bag" else Stores.ROS2_HUMBLE)
    types = store.types
    sequence = {"seq": 0} if kind == "bag" else {}
    letters = "DKRP" if kind == "bag" else "dkrp"
    topics = {
        "/camera/depth/image": "sensor_msgs/msg/Image",
        "/camera/depth/camera_info": "sensor_msgs/msg/CameraInfo",
        "/odom": "nav_msgs/msg/Odometry",
    }

    def point(name: str, values) -> object:
        return types[f"geometry_msgs/msg/{name}"](*map(float, values))

    writer = Writer1(file) if kind == "bag" else Writer2(file, version=8, storage_plugin=StoragePlugin.MCAP)
    with writer as bag:
        connections = {
            topic: bag.add_connection(topic, name, typestore=store) for topic, name in topics.items()
        }
        for number, (image, place) in enumerate(zip(images, places_m, strict=True)):
            time_ns = round(step_s * 1e9) * number + 7_000_000_000
            stamp = types["builtin_interfaces/msg/Time"](*divmod(time_ns, 1_000_000_000))
            header = types["std_msgs/msg/Header"](stamp=stamp, frame_id="map", **sequence)
            raw = image if encoding == "16UC1" else np.where(image > 0, image / 1000.0, np.nan).astype("<f4")
            data = np.frombuffer(np.ascontiguousarray(raw).tobytes(), dtype=np.uint8)
            height, width = image.shape
            region = types["sensor_msgs/msg/RegionOfInterest"](0, 0, 0, 0, False)
            matrices = [np.zeros(5), camera.ravel(), np.eye(3).ravel(), np.zeros(12)]
            pose = types["geometry_msgs/msg/Pose"](
                position=point("Point", place), orientation=point("Quaternion", (0, 0, 0, 1))
            )
            twist = types["geometry_msgs/msg/Twist"](
                linear=point("Vector3", (1, 0, 0)), angular=point("Vector3", (0, 0, 0))
            )
            no = np.zeros(36)
            said = {
                "/camera/depth/image": types["sensor_msgs/msg/Image"](
                    header=header, height=height, width=width, encoding=encoding, is_bigendian=0,
                    step=width * raw.itemsize, data=data,
                ),
                "/camera/depth/camera_info": types["sensor_msgs/msg/CameraInfo"](
                    header=header, height=height, width=width, distortion_model="", binning_x=0, binning_y=0,
                    roi=region, **dict(zip(letters, matrices, strict=True)),
                ),
                "/odom": types["nav_msgs/msg/Odometry"](
                    header=header, child_frame_id="base_link",
                    pose=types["geometry_msgs/msg/PoseWithCovariance"](pose=pose, covariance=no),
                    twist=types["geometry_msgs/msg/TwistWithCovariance"](twist=twist, covariance=no),
                ),
            }  # fmt: skip
            for topic, message in said.items():
                write = store.serialize_ros1 if kind == "bag" else store.serialize_cdr
                bag.write(connections[topic], time_ns, write(message, topics[topic]))
    return file

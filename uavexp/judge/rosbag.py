"""A ROS 1 or ROS 2 bag, or an MCAP of ROS 2 messages: the topic that tells positions, and plans as paths."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore

from uavexp.arrays import Float
from uavexp.geometry import quaternion_from_rotation, rotation_from_quaternion
from uavexp.judge.poses import Row, body_of, odometry, pose, recording_of, topic_of, transform, xyz
from uavexp.judge.recording import Plan, Recording, from_ned, from_ned_frd, new_paths

_PATH, _TRANSFORMS = "nav_msgs/msg/Path", "tf2_msgs/msg/TFMessage"


def _px4_local(message: Any) -> Row:
    position, velocity = from_ned(
        np.array([[message.x, message.y, message.z], [message.vx, message.vy, message.vz]], dtype=np.float64)
    )
    return position, None, velocity


def _px4_odometry(message: Any) -> Row:
    (position,) = from_ned(np.array([message.position], dtype=np.float64))
    rotation = from_ned_frd(rotation_from_quaternion(np.array(message.q, dtype=np.float64))[None])[0]
    return position, quaternion_from_rotation(rotation), None


# the first kind that a bag has tells positions
POSITIONS: dict[str, Callable[[Any], Row]] = {
    "nav_msgs/msg/Odometry": lambda message: odometry(message.pose.pose, message.twist.twist.linear),
    "px4_msgs/msg/VehicleOdometry": _px4_odometry,
    "px4_msgs/msg/VehicleLocalPosition": _px4_local,
    "geometry_msgs/msg/PoseStamped": lambda message: pose(message.pose),
    "geometry_msgs/msg/PoseWithCovarianceStamped": lambda message: pose(message.pose.pose),
    "geometry_msgs/msg/TransformStamped": lambda message: transform(message.transform),
    "geometry_msgs/msg/PointStamped": lambda message: (xyz(message.point), None, None),
    _TRANSFORMS: lambda message: transform(message.transform),
}


def read(path: Path, topic: str | None) -> Recording:
    """Read the topic asked for, else the only one of the likeliest kind."""
    with AnyReader([path], default_typestore=get_typestore(Stores.ROS2_HUMBLE)) as bag:
        kinds = {connection.topic: connection.msgtype for connection in bag.connections}
        wanted, frame = topic_of(path, kinds, POSITIONS, topic)
        kind, source = kinds[wanted], wanted
        stamped = list(messages_of(bag, wanted))
        plans = _plans(bag, kinds)
    if kind == _TRANSFORMS:
        parts = [(time_ns, part) for time_ns, message in stamped for part in message.transforms]
        frame = frame or body_of(wanted, sorted({part.child_frame_id for _, part in parts}))
        stamped = [(time_ns, part) for time_ns, part in parts if part.child_frame_id == frame]
        source = f"{wanted}:{frame}"
    return recording_of(
        path, source, stamps_s(stamped), [POSITIONS[kind](message) for _, message in stamped], plans
    )


def messages_of(bag: AnyReader, topic: str) -> Iterator[tuple[int, Any]]:
    """Time of the bag, ns, and message of a topic, in order."""
    connections = [connection for connection in bag.connections if connection.topic == topic]
    for connection, time_ns, raw in bag.messages(connections=connections):
        yield time_ns, bag.deserialize(raw, connection.msgtype)


def stamps_s(stamped: Sequence[tuple[int, Any]]) -> Float:
    """Of the headers; of the bag where there are none, or nobody filled them in."""
    said_ns = [_said_ns(message) for _, message in stamped]
    return 1e-9 * np.array(said_ns if any(said_ns) else [time_ns for time_ns, _ in stamped], dtype=np.float64)


def _said_ns(message: Any) -> int:
    stamp = getattr(getattr(message, "header", None), "stamp", None)
    if stamp is not None:
        return int(stamp.sec) * 1_000_000_000 + int(stamp.nanosec)
    return 1000 * int(getattr(message, "timestamp", 0))  # PX4's, us


def _plans(bag: AnyReader, kinds: Mapping[str, str]) -> tuple[Plan, ...] | None:
    """Of the one topic of paths, or of the one that is called a plan."""
    topics = sorted(topic for topic, kind in kinds.items() if kind == _PATH)
    topics = [topic for topic in topics if "plan" in topic] or topics
    if len(topics) != 1:
        return None
    stamped = list(messages_of(bag, topics[0]))
    plans = [
        Plan(
            time_s=time_s,
            path_m=np.array([xyz(item.pose.position) for item in message.poses]).reshape(-1, 3),
        )
        for time_s, (_, message) in zip(stamps_s(stamped).tolist(), stamped, strict=True)
    ]
    return new_paths([plan for plan in plans if len(plan.path_m)])

"""A flight as a ROS 2 bag (sqlite3, messages of Humble), without ROS being installed.

/tf tf2_msgs/TFMessage; /state nav_msgs/Odometry; /reference geometry_msgs/PoseStamped;
/map sensor_msgs/PointCloud2, voxels mapped as occupied so far; /plan nav_msgs/Path; /causes std_msgs/String.
Time 0 is the start.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.rosbag2 import Writer
from rosbags.typesys import Stores, get_typestore

from uavexp.arrays import Float
from uavexp.export import moments
from uavexp.export.map_voxels import mapped_until_m
from uavexp.geometry import rotation_from_quaternion
from uavexp.log import TrialLog
from uavexp.store.stored_trial import StoredTrial

TOPICS = {
    "/tf": "tf2_msgs/msg/TFMessage",
    "/state": "nav_msgs/msg/Odometry",
    "/reference": "geometry_msgs/msg/PoseStamped",
    "/map": "sensor_msgs/msg/PointCloud2",
    "/plan": "nav_msgs/msg/Path",
    "/causes": "std_msgs/msg/String",
}
_STORE = get_typestore(Stores.ROS2_HUMBLE)
_T = {name.rsplit("/", 1)[1]: kind for name, kind in _STORE.types.items()}
_FLOAT32 = 7  # sensor_msgs/PointField
_NO_COVARIANCE = np.zeros(36)

Message = tuple[float, str, Any]  # time s, topic, what


def write(trial: StoredTrial, file: Path) -> Sequence[Path]:
    """Write the bag, a folder; its messages in the order of time."""
    messages = [*_poses(trial.log), *_maps(trial.log), *_plans(trial.log)]
    with Writer(file, version=8) as bag:
        connections = {
            topic: bag.add_connection(topic, kind, typestore=_STORE) for topic, kind in TOPICS.items()
        }
        for time_s, topic, message in sorted(messages, key=lambda item: item[0]):
            bag.write(connections[topic], round(time_s * 1e9), _STORE.serialize_cdr(message, TOPICS[topic]))
    return [file]


def _poses(log: TrialLog) -> Iterator[Message]:
    steps = log.steps
    for row in moments.rows_at(log, moments.POSE_HZ):
        time_s, q = float(steps.time_s[row]), steps.quaternion_wxyz[row]
        header, turned = _header(time_s), _quaternion(q)
        moved = _T["Transform"](translation=_vector(steps.position_m[row]), rotation=turned)
        transform = _T["TransformStamped"](header=header, child_frame_id="body", transform=moved)
        yield time_s, "/tf", _T["TFMessage"](transforms=[transform])
        pose = _T["Pose"](position=_point(steps.position_m[row]), orientation=turned)
        body_mps = rotation_from_quaternion(q).T @ steps.velocity_mps[row]
        twist = _T["Twist"](linear=_vector(body_mps), angular=_vector(np.zeros(3)))
        yield (
            time_s,
            "/state",
            _T["Odometry"](
                header=header,
                child_frame_id="body",
                pose=_T["PoseWithCovariance"](pose=pose, covariance=_NO_COVARIANCE),
                twist=_T["TwistWithCovariance"](twist=twist, covariance=_NO_COVARIANCE),
            ),
        )
        asked = _T["Pose"](position=_point(steps.reference_position_m[row]), orientation=turned)
        yield time_s, "/reference", _T["PoseStamped"](header=header, pose=asked)


def _maps(log: TrialLog) -> Iterator[Message]:
    fields = [
        _T["PointField"](name=axis, offset=4 * index, datatype=_FLOAT32, count=1)
        for index, axis in enumerate("xyz")
    ]
    for time_s in moments.map_times_s(log).tolist():
        points_m = mapped_until_m(log, time_s).astype("<f4")
        yield (
            time_s,
            "/map",
            _T["PointCloud2"](
                header=_header(time_s),
                height=1,
                width=len(points_m),
                fields=fields,
                is_bigendian=False,
                point_step=12,
                row_step=points_m.nbytes,
                data=np.frombuffer(points_m.tobytes(), dtype=np.uint8),
                is_dense=True,
            ),
        )


def _plans(log: TrialLog) -> Iterator[Message]:
    for change in moments.plan_changes(log):
        yield change.time_s, "/causes", _T["String"](data=change.words)
        if np.isfinite(change.effective_s) and len(change.trajectory_m):
            header, turned = _header(change.effective_s), _quaternion(np.array([1.0, 0.0, 0.0, 0.0]))
            poses = [
                _T["PoseStamped"](header=header, pose=_T["Pose"](position=_point(place), orientation=turned))
                for place in change.trajectory_m
            ]
            yield change.effective_s, "/plan", _T["Path"](header=header, poses=poses)


def _header(time_s: float) -> Any:
    second, nanosecond = divmod(round(time_s * 1e9), 1_000_000_000)
    return _T["Header"](stamp=_T["Time"](sec=second, nanosec=nanosecond), frame_id="world")


def _point(values: Float) -> Any:
    x, y, z = values.tolist()
    return _T["Point"](x=x, y=y, z=z)


def _vector(values: Float) -> Any:
    x, y, z = values.tolist()
    return _T["Vector3"](x=x, y=y, z=z)


def _quaternion(q: Float) -> Any:
    w, x, y, z = q.tolist()
    return _T["Quaternion"](x=x, y=y, z=z, w=w)

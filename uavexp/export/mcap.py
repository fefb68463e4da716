"""A flight for Foxglove: MCAP with Foxglove's own schemas (Protobuf), and a layout to look at it with.

/tf                world to body, 50 a second         /vehicle  its body, in its own frame
/state             true pose and velocity             /map      voxels mapped as occupied so far
/estimate          pose believed                      /plan     the trajectory flown
/reference         pose asked for                     /replans  where plans were asked for, by cause
/movers            moving obstacles in truth          /causes   why, in words
/figures           clearance, speed, tracking error (JSON, to plot)
A log keeps no depth images, so there are none. Time 0 is the start.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import foxglove
import numpy as np
from foxglove import channels as ch
from foxglove import messages as m

from uavexp.arrays import Float
from uavexp.bodies import present
from uavexp.export import moments
from uavexp.export.map_voxels import mapped_until_m
from uavexp.geometry import rotation_from_quaternion
from uavexp.log import TrialLog
from uavexp.metrics import tracking
from uavexp.store.stored_trial import StoredTrial
from uavexp.types import Shape

LAYOUT = Path(__file__).with_name("foxglove_layout.json")
WORLD, BODY = "world", "body"
_VEHICLE_RADIUS_M, _VEHICLE_HEIGHT_M = 0.2, 0.1  # where the log does not tell
_VEHICLE = m.Color(r=0.0, g=0.45, b=0.7, a=1.0)
_MOVER = m.Color(r=0.53, g=0.13, b=0.33, a=0.9)
_STRIP = m.LinePrimitiveLineType.LineStrip
_FLOAT32 = m.PackedElementFieldNumericType.Float32
_FIGURES = {"type": "object", "properties": {
    name: {"type": "number"} for name in ("clearance_m", "speed_mps", "tracking_error_m")
}}  # fmt: skip


def write(trial: StoredTrial, file: Path) -> Sequence[Path]:
    """Write the recording; returns it and the layout to import in Foxglove."""
    context = foxglove.Context()  # its own: two exports do not mix
    with foxglove.open_mcap(file, allow_overwrite=True, context=context):
        _write_vehicle(trial.log, context)
        _write_poses(trial.log, context)
        _write_map(trial.log, context)
        _write_plans(trial.log, context)
        if trial.log.movers.shape.size:
            _write_movers(trial.log, context)
    return [file, LAYOUT]


def _write_vehicle(log: TrialLog, context: foxglove.Context) -> None:
    radius_m = log.limits.body_radius_m if np.isfinite(log.limits.body_radius_m) else _VEHICLE_RADIUS_M
    size = m.Vector3(x=2.0 * radius_m, y=2.0 * radius_m, z=_VEHICLE_HEIGHT_M)
    body = m.CylinderPrimitive(
        pose=_pose(np.zeros(3)), size=size, bottom_scale=1.0, top_scale=1.0, color=_VEHICLE
    )
    nose = m.ArrowPrimitive(
        pose=_pose(np.zeros(3)), shaft_length=1.5 * radius_m, shaft_diameter=0.05, head_length=0.15,
        head_diameter=0.12, color=_VEHICLE,
    )  # fmt: skip
    entity = m.SceneEntity(frame_id=BODY, id="vehicle", frame_locked=True, cylinders=[body], arrows=[nose])
    channel = ch.SceneUpdateChannel("/vehicle", context=context)
    channel.log(m.SceneUpdate(entities=[entity]), log_time=_ns(float(log.steps.time_s[0])))


def _write_poses(log: TrialLog, context: foxglove.Context) -> None:
    transforms = ch.FrameTransformChannel("/tf", context=context)
    states = ch.OdometryChannel("/state", context=context)
    estimates = ch.PoseInFrameChannel("/estimate", context=context)
    references = ch.PoseInFrameChannel("/reference", context=context)
    figures = foxglove.Channel("/figures", schema=_FIGURES, context=context)
    steps = log.steps
    error_m = tracking.distances_m(steps.position_m, steps.reference_position_m)
    for row in moments.rows_at(log, moments.POSE_HZ):
        time_s, position_m, q = float(steps.time_s[row]), steps.position_m[row], steps.quaternion_wxyz[row]
        now, stamp = _ns(time_s), _stamp(time_s)
        body_mps = rotation_from_quaternion(q).T @ steps.velocity_mps[row]
        transforms.log(
            m.FrameTransform(
                timestamp=stamp, parent_frame_id=WORLD, child_frame_id=BODY, translation=_vector(position_m),
                rotation=_quaternion(q),
            ),
            log_time=now,
        )  # fmt: skip
        states.log(
            m.Odometry(
                timestamp=stamp, frame_id=WORLD, body_frame_id=BODY, pose=_pose(position_m, q),
                linear_velocity=_vector(body_mps),
            ),
            log_time=now,
        )  # fmt: skip
        for channel, place_m in (
            (estimates, steps.estimated_position_m[row]),
            (references, steps.reference_position_m[row]),
        ):
            pose = m.PoseInFrame(timestamp=stamp, frame_id=WORLD, pose=_pose(place_m, q))
            channel.log(pose, log_time=now)
        found = {
            "clearance_m": float(steps.clearance_m[row]),
            "speed_mps": float(np.linalg.norm(body_mps)),
            "tracking_error_m": float(error_m[row]),
        }
        figures.log(
            {name: value if np.isfinite(value) else None for name, value in found.items()}, log_time=now
        )


def _write_map(log: TrialLog, context: foxglove.Context) -> None:
    channel = ch.PointCloudChannel("/map", context=context)
    fields = [
        m.PackedElementField(name=axis, offset=4 * index, type=_FLOAT32) for index, axis in enumerate("xyz")
    ]
    for time_s in moments.map_times_s(log).tolist():
        cloud = m.PointCloud(
            timestamp=_stamp(time_s), frame_id=WORLD, pose=_pose(np.zeros(3)), point_stride=12, fields=fields,
            data=mapped_until_m(log, time_s).astype("<f4").tobytes(),
        )  # fmt: skip
        channel.log(cloud, log_time=_ns(time_s))


def _write_plans(log: TrialLog, context: foxglove.Context) -> None:
    plans = ch.SceneUpdateChannel("/plan", context=context)
    places = ch.SceneUpdateChannel("/replans", context=context)
    causes = ch.LogChannel("/causes", context=context)
    for number, change in enumerate(moments.plan_changes(log)):
        red, green, blue = moments.colour_rgb(change.colour)
        colour, stamp = m.Color(r=red, g=green, b=blue, a=1.0), _stamp(change.time_s)
        line = m.Log(timestamp=stamp, level=m.LogLevel.Info, message=change.words, name=change.cause)
        causes.log(line, log_time=_ns(change.time_s))
        ball = m.SpherePrimitive(
            pose=_pose(change.position_m), size=m.Vector3(x=0.25, y=0.25, z=0.25), color=colour
        )
        told = [m.KeyValuePair(key="cause", value=change.cause)]
        place = m.SceneEntity(
            timestamp=stamp, frame_id=WORLD, id=f"replan {number}", spheres=[ball], metadata=told
        )
        places.log(m.SceneUpdate(entities=[place]), log_time=_ns(change.time_s))
        if np.isfinite(change.effective_s) and len(change.trajectory_m):
            points = [m.Point3(x=x, y=y, z=z) for x, y, z in change.trajectory_m.tolist()]
            strip = m.LinePrimitive(type=_STRIP, thickness=0.05, points=points, color=colour)
            plan = m.SceneEntity(
                timestamp=_stamp(change.effective_s), frame_id=WORLD, id="plan", lines=[strip]
            )
            plans.log(m.SceneUpdate(entities=[plan]), log_time=_ns(change.effective_s))


def _write_movers(log: TrialLog, context: foxglove.Context) -> None:
    channel = ch.SceneUpdateChannel("/movers", context=context)
    movers = log.movers
    for row in moments.rows_at(log, moments.MOVER_HZ):
        time_s, places_m = float(log.steps.time_s[row]), movers.position_m[row].astype(np.float64)
        entities = [
            _mover(
                f"mover {index}", Shape(int(movers.shape[index])), places_m[index], movers.half_size_m[index]
            )
            for index in np.flatnonzero(present(places_m))
        ]
        gone = m.SceneEntityDeletion(type=m.SceneEntityDeletionType.All)
        channel.log(m.SceneUpdate(deletions=[gone], entities=entities), log_time=_ns(time_s))


def _mover(name: str, shape: Shape, position_m: Float, half_size_m: Float) -> Any:
    known: dict[str, Any] = {"pose": _pose(position_m), "size": _vector(2.0 * half_size_m), "color": _MOVER}
    if shape is Shape.SPHERE:
        return m.SceneEntity(frame_id=WORLD, id=name, spheres=[m.SpherePrimitive(**known)])
    if shape is Shape.BOX:
        return m.SceneEntity(frame_id=WORLD, id=name, cubes=[m.CubePrimitive(**known)])
    pillar = m.CylinderPrimitive(**known, bottom_scale=1.0, top_scale=1.0)
    return m.SceneEntity(frame_id=WORLD, id=name, cylinders=[pillar])


def _pose(position_m: Float, q: Float | None = None) -> Any:
    turned = m.Quaternion(w=1.0) if q is None else _quaternion(q)
    return m.Pose(position=_vector(position_m), orientation=turned)


def _vector(values: Float) -> Any:
    x, y, z = values.tolist()
    return m.Vector3(x=x, y=y, z=z)


def _quaternion(q: Float) -> Any:
    w, x, y, z = q.tolist()
    return m.Quaternion(w=w, x=x, y=y, z=z)


def _ns(time_s: float) -> int:
    return round(time_s * 1e9)


def _stamp(time_s: float) -> Any:
    return m.Timestamp(*divmod(_ns(time_s), 1_000_000_000))

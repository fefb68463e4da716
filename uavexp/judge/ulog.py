"""A PX4 log: `vehicle_local_position`, attitude, setpoints; north east down turned to z up."""

from __future__ import annotations

import contextlib
import io
from pathlib import Path
from typing import Any

import numpy as np
from pyulog import ULog

from uavexp.arrays import Bool, Float
from uavexp.errors import ConfigError, RecordError
from uavexp.geometry import quaternion_from_rotation, rotation_from_quaternion
from uavexp.judge.recording import Plan, Recording, Track, from_ned, from_ned_frd

_POSITION, _ATTITUDE = "vehicle_local_position", "vehicle_attitude"
_SETPOINT, _GOALS = "vehicle_local_position_setpoint", "position_setpoint_triplet"
_WANTED = (_POSITION, _ATTITUDE, _SETPOINT, _GOALS)
_DEGREE_M = 111_000.0  # of latitude
_SAME_M = 0.1

Columns = dict[str, Any]


def read(path: Path, topic: str | None) -> Recording:
    """Read the log; what EKF2 marks as invalid is left out."""
    if topic not in (None, _POSITION):
        raise ConfigError(f"{path}: of a PX4 log positions are read from {_POSITION}, not from {topic}")
    with contextlib.redirect_stdout(io.StringIO()) as said:  # pyulog prints what it finds damaged
        log = ULog(str(path), message_name_filter_list=list(_WANTED))
    data: dict[str, Columns] = {item.name: item.data for item in reversed(log.data_list)}  # instance 0 counts
    if _POSITION not in data:
        raise RecordError(f"{path}: no position: the log has no {_POSITION}")
    local = data[_POSITION]
    valid = _flag(local, "xy_valid") & _flag(local, "z_valid")
    if not valid.any():
        raise RecordError(f"{path}: no position: none of {_POSITION} is valid (xy_valid, z_valid)")
    time_s = _time_s(local)[valid]
    velocity = _flag(local, "v_xy_valid")[valid] & _flag(local, "v_z_valid")[valid]
    return Recording(
        path=path,
        source=_POSITION,
        position_m=Track(time_s=time_s, values=_vectors(local, "x", "y", "z")[valid]),
        velocity_mps=Track(time_s=time_s, values=_vectors(local, "vx", "vy", "vz")[valid])
        if velocity.all()
        else None,
        quaternion_wxyz=_attitude(data.get(_ATTITUDE)),
        reference_m=_reference(data.get(_SETPOINT)),
        plans=_goals(data.get(_GOALS)),
        notes=_notes(local, valid, said.getvalue()),
    )


def _time_s(columns: Columns) -> Float:
    return np.asarray(columns["timestamp"], dtype=np.float64) * 1e-6


def _flag(columns: Columns, name: str) -> Bool:
    return np.asarray(columns.get(name, np.ones(len(columns["timestamp"]))), dtype=np.bool_)


def _vectors(columns: Columns, *names: str) -> Float:
    return from_ned(np.column_stack([columns[name] for name in names]).astype(np.float64))


def _attitude(columns: Columns | None) -> Track | None:
    if columns is None:
        return None
    quaternions = np.column_stack([columns[f"q[{n}]"] for n in range(4)]).astype(np.float64)
    rotations = from_ned_frd(np.array([rotation_from_quaternion(q) for q in quaternions]))
    return Track(
        time_s=_time_s(columns), values=np.array([quaternion_from_rotation(item) for item in rotations])
    )


def _reference(columns: Columns | None) -> Track | None:
    return (
        None if columns is None else Track(time_s=_time_s(columns), values=_vectors(columns, "x", "y", "z"))
    )


def _goals(columns: Columns | None) -> tuple[Plan, ...] | None:
    """The goals flown to, each when it first differs from the one before."""
    if columns is None or "current.lat" not in columns:
        return None
    lat, lon, alt = (
        np.asarray(columns[f"current.{name}"], dtype=np.float64) for name in ("lat", "lon", "alt")
    )
    there = _flag(columns, "current.valid") & np.isfinite(lat + lon + alt)
    places = np.column_stack([lon * np.cos(np.radians(lat)), lat, alt / _DEGREE_M]) * _DEGREE_M
    plans: list[Plan] = []
    before: Float | None = None
    for time_s, place in zip(_time_s(columns)[there].tolist(), places[there], strict=True):
        if before is None or float(np.linalg.norm(place - before)) > _SAME_M:
            plans.append(Plan(time_s=time_s, path_m=np.zeros((0, 3)), cause="setpoint"))
        before = place
    return tuple(plans)


def _notes(local: Columns, valid: Bool, said: str) -> tuple[str, ...]:
    notes = []
    if not valid.all():
        notes.append(
            f"{int(np.count_nonzero(~valid))} positions that the estimator marks as invalid are left out"
        )
    resets = sum(
        int(np.count_nonzero(np.diff(np.asarray(local[name])[valid].astype(np.int64))))
        for name in ("xy_reset_counter", "z_reset_counter")
        if name in local
    )
    if resets:
        notes.append(f"the estimator reset its position {resets} times: such jumps count as flown")
    if "corrupt" in said.lower():
        notes.append("the log is damaged in places; what could be read is judged")
    return tuple(notes)

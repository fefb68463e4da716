"""A csv with a header, or a trajectory as TUM writes it: `time x y z qx qy qz qw`, separated by blanks.

A header may be ours (`time_s`, `position_x_m`), EuRoC's (`#timestamp [ns]`, `p_RS_R_x [m]`) or any other
with a time and three columns that end in x, y, z.
"""

from __future__ import annotations

import csv
import re
from pathlib import Path

import numpy as np

from uavexp.arrays import Float
from uavexp.errors import ConfigError, RecordError
from uavexp.judge.recording import Plan, Recording, Track

_TIME = re.compile(r"(?:time|timestamp|stamp|t)[ _]*\[?(s|ms|us|ns)?\]?")
_SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
_SINCE_1970 = {"ns": 1e17, "us": 1e14, "ms": 1e11}
_POSITIONS = ("position_{}_m", "position_{}", "p_rs_r_{} [m]", "pose.position.{}", "position.{}",
              "pose.pose.position.{}", "p{}", "pos_{}", "t{}", "{}_m", "{}")  # fmt: skip
_VELOCITIES = ("velocity_{}_mps", "velocity_{}", "v_rs_r_{} [m s^-1]", "v{}", "vel_{}")
_QUATERNIONS = (
    "quaternion_{}",
    "q_rs_{} []",
    "pose.orientation.{}",
    "pose.pose.orientation.{}",
    "orientation.{}",
    "q{}",
)
_REFERENCES = ("reference_position_{}_m",)
_TUM = ("time", "x", "y", "z", "qx", "qy", "qz", "qw")


def read(path: Path, topic: str | None) -> Recording:
    """Read the table; other columns are ignored."""
    if topic is not None:
        raise ConfigError(f"{path}: a table has no topics; leave out --topic {topic}")
    names, rows = _cells(path)
    number = {name: index for index, name in reversed(list(enumerate(names)))}
    time = next((name for name in names if _TIME.fullmatch(name)), None)
    position = _found(number, _POSITIONS, "xyz")
    if time is None or position is None:
        lacking = "time" if time is None else "x, y, z"
        raise RecordError(
            f"{path}: no position over time: no columns of {lacking}; it has {', '.join(names)[:200]}"
        )
    match = _TIME.fullmatch(time)
    time_s = _numbers(path, rows, [number[time]])[:, 0]
    unit_s = _SECONDS[(match[1] if match else None) or _clock(time_s)]
    time_s = (time_s - time_s[0]) * unit_s if len(time_s) else time_s  # nanoseconds since 1970 lose digits

    def track(known: tuple[str, ...], axes: str) -> Track | None:
        columns = _found(number, known, axes)
        return None if columns is None else Track(time_s=time_s, values=_numbers(path, rows, columns))

    return Recording(
        path=path,
        source=f"columns {names[position[0]]}, {names[position[1]]}, {names[position[2]]}",
        position_m=Track(time_s=time_s, values=_numbers(path, rows, position)),
        velocity_mps=track(_VELOCITIES, "xyz"),
        quaternion_wxyz=track(_QUATERNIONS, "wxyz"),
        reference_m=track(_REFERENCES, "xyz"),
        plans=_plans(number, rows, time_s),
    )


def _clock(times: Float) -> str:
    """The unit of a clock that counts since 1970, by its digits; of any other seconds."""
    latest = float(np.nanmax(times, initial=0.0))
    return next((unit for unit, least in _SINCE_1970.items() if latest > least), "s")


def _cells(path: Path) -> tuple[list[str], list[list[str]]]:
    """Names of the columns in small letters, and rows."""
    text = path.read_text(encoding="utf-8-sig")  # a UnicodeDecodeError is told as damage
    lines = [line for line in text.splitlines() if line.strip()]
    if path.suffix.lower() != ".csv":
        body = [line.split() for line in lines if not line.lstrip().startswith("#")]
        return list(_TUM[: max(map(len, body), default=0)]), _whole(path, body, 4)
    if not lines:
        raise RecordError(f"{path}: no rows")
    separator = max(",;\t", key=lines[0].count)
    header, *body = csv.reader(lines, delimiter=separator)
    names = [name.strip().lstrip("#").strip().lower() for name in header]
    if separator == ";":
        body = [[cell.replace(",", ".") for cell in row] for row in body]
    return names, _whole(path, [row for row in body if not row[0].startswith("#")], len(names))


def _whole(path: Path, rows: list[list[str]], least: int) -> list[list[str]]:
    for number, row in enumerate(rows):
        if len(row) < least:
            raise RecordError(f"{path}: row {number} has {len(row)} columns, {least} are needed")
    return rows


def _found(number: dict[str, int], known: tuple[str, ...], axes: str) -> list[int] | None:
    """Places of the columns of a vector: the first way of naming them that all axes have."""
    for name in known:
        if all(name.format(axis) in number for axis in axes):
            return [number[name.format(axis)] for axis in axes]
    return None


def _numbers(path: Path, rows: list[list[str]], columns: list[int]) -> Float:
    """Columns (N, D); an empty cell is NaN."""
    try:
        cells = [[row[column].strip() or "nan" for column in columns] for row in rows]
        return np.array(cells, dtype=np.float64).reshape(-1, len(columns))
    except ValueError as error:
        raise RecordError(f"{path}: {error}") from error


def _plans(number: dict[str, int], rows: list[list[str]], time_s: Float) -> tuple[Plan, ...] | None:
    """A column `replan` names causes where it is not empty or 0."""
    if "replan" not in number:
        return None
    causes = [row[number["replan"]].strip() for row in rows]
    return tuple(
        Plan(time_s=time, path_m=np.zeros((0, 3)), cause="plan" if cause == "1" else cause)
        for time, cause in zip(time_s.tolist(), causes, strict=True)
        if cause not in ("", "0")
    )

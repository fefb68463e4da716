"""Point clouds of the Point Cloud Library (`.pcd`, versions .5 to .7)."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from uavexp.arrays import Float
from uavexp.errors import WorldError
from uavexp.formats import base, lzf
from uavexp.formats.base import Content, Options
from uavexp.formats.text import BLANKS, check_last_row, rows

_HEADER = 65536  # bytes in which the header must end
_TYPES = {"F": (4, 8), "I": (1, 2, 4, 8), "U": (1, 2, 4, 8)}  # bytes of a number of each type
_AXES = ("x", "y", "z")
_KEYS = {"FIELDS", "COLUMNS", "SIZE", "TYPE", "COUNT", "WIDTH", "HEIGHT", "POINTS", "DATA"}


@dataclass(frozen=True, slots=True, kw_only=True)
class Header:
    """Where the coordinates lie; fields may stand in any order, others between them."""

    points: int
    data: str  # ascii, binary or binary_compressed
    begin: int  # byte of the file
    kinds: tuple[np.dtype[np.generic], ...]  # of x, y, z
    offsets: tuple[int, ...]  # byte of a point
    columns: tuple[int, ...]  # of a row
    width: int  # words of a row
    point_bytes: int


def read(path: Path, options: Options) -> Content:
    """Return the points (x, y, z); the sensor's pose (VIEWPOINT) is left alone, as PCL does."""
    header = read_header(path)
    if header.data == "ascii":
        points = _ascii(path, header)
    elif header.data == "binary":
        points = _binary(path, header)
    else:
        points = _compressed(path, header)
    return base.cloud(path, "pcd cloud", points)


def read_header(path: Path) -> Header:
    """Return the header; raise `WorldError` unless the fields are whole and x, y, z are among them."""
    with path.open("rb") as file:
        head = file.read(_HEADER)
    values, begin = _entries(path, head)
    names = values.get("FIELDS") or values.get("COLUMNS") or []
    missing = [axis for axis in _AXES if axis not in names]
    if missing:
        raise WorldError(f"world file {path} has no field {' '.join(missing)}; its fields are {names[:20]}")
    sizes = _integers(path, "SIZE", values.get("SIZE", ["4"] * len(names)), len(names))
    counts = _integers(path, "COUNT", values.get("COUNT", ["1"] * len(names)), len(names))
    types = values.get("TYPE", ["F"] * len(names))
    if len(types) != len(names):
        raise WorldError(f"world file {path} is damaged: TYPE needs {len(names)} letters, got {len(types)}")
    where = [names.index(axis) for axis in _AXES]
    for index in where:
        if sizes[index] not in _TYPES.get(types[index], ()) or counts[index] != 1:
            raise WorldError(
                f"world file {path}: field {names[index]} must be one number of type F 4 8, I or U 1 2 4 8, "
                f"got {counts[index]} of {types[index]} {sizes[index]}"
            )
    starts = np.cumsum([0, *(size * count for size, count in zip(sizes, counts, strict=True))])
    columns = np.cumsum([0, *counts])
    return Header(
        points=_points(path, values),
        data=values["DATA"][0],
        begin=begin,
        kinds=tuple(np.dtype(f"<{types[index].lower()}{sizes[index]}") for index in where),
        offsets=tuple(int(starts[index]) for index in where),
        columns=tuple(int(columns[index]) for index in where),
        width=int(columns[-1]),
        point_bytes=int(starts[-1]),
    )


def _entries(path: Path, head: bytes) -> tuple[dict[str, list[str]], int]:
    """Words of each header line by its key, and the byte after the last one, DATA."""
    values: dict[str, list[str]] = {}
    begin = 0
    while "DATA" not in values:
        end = head.find(b"\n", begin)
        if end < 0:
            raise WorldError(f"world file {path} is no pcd file, or its header is truncated")
        words = head[begin:end].decode("latin-1").split()
        begin = end + 1
        if words and words[0].upper() in _KEYS:
            values[words[0].upper()] = words[1:]
    if values["DATA"] not in (["ascii"], ["binary"], ["binary_compressed"]):
        raise WorldError(
            f"world file {path}: DATA must be ascii, binary or binary_compressed, got {values['DATA'][:5]}"
        )
    return values, begin


def _integers(path: Path, key: str, words: list[str], count: int) -> list[int]:
    numbers = [int(word) if word.isascii() and word.isdigit() and len(word) < 10 else 0 for word in words]
    if len(numbers) != count or min(numbers, default=0) < 1:
        raise WorldError(f"world file {path} is damaged: {key} needs {count} whole numbers >= 1")
    return numbers


def _points(path: Path, values: dict[str, list[str]]) -> int:
    """Promised number of points; WIDTH times HEIGHT must be the same."""
    given = [_integers(path, key, values[key], 1)[0] for key in ("WIDTH", "HEIGHT") if key in values]
    if "POINTS" not in values and len(given) < 2:
        raise WorldError(f"world file {path} is no pcd file, or its header is truncated: no POINTS in it")
    area = given[0] * given[1] if len(given) == 2 else None
    points = _integers(path, "POINTS", values["POINTS"], 1)[0] if "POINTS" in values else area
    assert points is not None
    if area is not None and points != area:
        raise WorldError(f"world file {path} is damaged: WIDTH times HEIGHT is {area}, POINTS {points}")
    return points


def _truncated(path: Path, header: Header, found: int) -> WorldError:
    return WorldError(
        f"world file {path} is damaged or truncated: {header.points} points promised, {found} found"
    )


def _ascii(path: Path, header: Header) -> Float:
    check_last_row(path, header.begin, BLANKS, header.width)
    with path.open("rb") as file:
        file.seek(header.begin)
        points = rows(path, file, header.columns)
    if len(points) != header.points:
        raise _truncated(path, header, len(points))
    return points


def _binary(path: Path, header: Header) -> Float:
    found = (path.stat().st_size - header.begin) // header.point_bytes
    if found < header.points:
        raise _truncated(path, header, found)
    layout = np.dtype(
        {
            "names": _AXES,
            "formats": header.kinds,
            "offsets": header.offsets,
            "itemsize": header.point_bytes,
        }
    )
    stored = np.memmap(path, dtype=layout, mode="r", offset=header.begin, shape=(header.points,))
    return np.stack([stored[axis].astype(np.float64) for axis in _AXES], axis=1)


def _compressed(path: Path, header: Header) -> Float:
    """Points of a block in which each field's numbers stand together, field after field."""
    data = np.frombuffer(path.read_bytes(), dtype=np.uint8, offset=header.begin)
    if data.size < 8:
        raise _truncated(path, header, 0)
    packed, size = (int(number) for number in data[:8].view("<u4"))
    if data.size < 8 + packed:
        raise WorldError(
            f"world file {path} is truncated: {packed} compressed bytes promised, {data.size - 8} found"
        )
    if size != header.points * header.point_bytes or size > packed * lzf.MOST_RATIO:
        raise WorldError(
            f"world file {path} is damaged: {header.points} points of {header.point_bytes} bytes cannot be "
            f"{packed} compressed bytes of {size}"
        )
    block = np.empty(size, dtype=np.uint8)
    if not lzf.decompress(data[8 : 8 + packed], block):
        raise WorldError(f"world file {path} is damaged: its compressed block does not unpack")
    columns = []
    for kind, offset in zip(header.kinds, header.offsets, strict=True):
        begin = header.points * offset
        columns.append(block[begin : begin + header.points * kind.itemsize].view(kind).astype(np.float64))
    return np.stack(columns, axis=1)

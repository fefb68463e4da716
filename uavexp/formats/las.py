"""Laser scans of surveyors (`.las`, `.laz`; ASPRS LAS 1.0 to 1.4)."""

from __future__ import annotations

import resource
import struct
import subprocess
import sys
import tempfile
from pathlib import Path

import laspy
import numpy as np

from uavexp.arrays import Float
from uavexp.errors import WorldError, one_line
from uavexp.formats import base
from uavexp.formats.base import Content, Options
from uavexp.formats.guard import damaged

_CHUNK = 1_000_000  # points read at once
MOST_POINTS = 200_000_000  # 4.8 GB
_MOST_RATIO = 1000  # of a laz file; real ones reach 20
_VLR_BYTES, _EVLR_BYTES = 54, 60  # of the head of a variable length record, and of an extended one
_CHILD_BYTES = 12 << 30  # memory of the child that unpacks
_UNPACK = "import sys; from uavexp.formats.las import unpack; sys.exit(unpack(*sys.argv[1:]))"


def read(path: Path, options: Options) -> Content:
    """Return the points, scale and offset of the header applied."""
    packed = _check_header(path)
    points = _unpacked(path) if packed else _points(path)
    return base.cloud(path, f"{'laz' if packed else 'las'} cloud", points)


def _check_header(path: Path) -> bool:
    """Whether the points are compressed; raise `WorldError` when the file has no room for its records."""
    size = path.stat().st_size
    with path.open("rb") as file:
        head = file.read(375)
    if head[:4] != b"LASF" or len(head) < 227:
        raise WorldError(f"world file {path} is no las file, or its header is truncated")
    header_size, begin, records = struct.unpack_from("<HII", head, 94)
    extended = struct.unpack_from("<I", head, 243)[0] if head[25] >= 4 and len(head) == 375 else 0
    if not header_size + records * _VLR_BYTES <= begin <= size or extended * _EVLR_BYTES > size:
        raise WorldError(
            f"world file {path} is damaged or truncated: {records} records, {extended} extended ones and "
            f"points from byte {begin} on do not fit its {size} bytes"
        )
    return head[104] >= 128


def _points(path: Path) -> Float:
    """Points (N, 3), as many as the header promises."""
    with damaged(path, "las"), laspy.open(path) as reader:
        header = reader.header
        promised = int(header.point_count)
        room = max(path.stat().st_size - header.offset_to_point_data, 0)
        most = room * (_MOST_RATIO if header.are_points_compressed else 1) // header.point_format.size
        if promised > most:
            raise WorldError(f"world file {path} is truncated: {promised} points promised, {most} have room")
        if promised > MOST_POINTS:
            raise WorldError(
                f"world file {path} promises {promised} points, {MOST_POINTS:.3g} are allowed: thin it"
            )
        points = np.empty((promised, 3))
        found = 0
        for chunk in reader.chunk_iterator(_CHUNK):
            for axis, values in enumerate((chunk.x, chunk.y, chunk.z)):
                points[found : found + len(chunk), axis] = values
            found += len(chunk)
    if found < promised:
        raise WorldError(f"world file {path} is truncated: {promised} points promised, {found} found")
    return points


def _unpacked(path: Path) -> Float:
    """Points of a compressed file, unpacked by a child: lazrs aborts the process that damage misleads."""
    if not laspy.LazBackend.detect_available():
        raise WorldError(f"world file {path}: reading .laz needs lazrs: pip install 'uavexp[formats]'")
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "points.npy"
        command = [sys.executable, "-c", _UNPACK, str(path), str(out)]
        child = subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, check=False)
        if child.returncode == 0:
            points: Float = np.load(out)
            return points
    reason = child.stdout.decode("utf-8", "replace").strip()
    raise WorldError(reason or f"world file {path} is damaged, truncated or no laz file")


def unpack(name: str, out: str) -> int:
    """Write the points of a file, in a process of its own; print why not and return 1."""
    hard = resource.getrlimit(resource.RLIMIT_AS)[1]
    limit = _CHILD_BYTES if hard == resource.RLIM_INFINITY else min(_CHILD_BYTES, hard)
    resource.setrlimit(resource.RLIMIT_AS, (limit, hard))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    try:
        np.save(out, _points(Path(name)))
    except WorldError as error:
        sys.stdout.write(one_line(error))
        return 1
    return 0

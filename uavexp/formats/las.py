"""Laser scans of surveyors (`.las`, `.laz`; ASPRS LAS 1.0 to 1.4)."""

from __future__ import annotations

from pathlib import Path

import laspy
import numpy as np

from uavexp.errors import WorldError
from uavexp.formats import base
from uavexp.formats.base import Content, Options
from uavexp.formats.guard import damaged

_CHUNK = 1_000_000  # points read at once
MOST_POINTS = 200_000_000  # 4.8 GB


def read(path: Path, options: Options) -> Content:
    """Return the points, scale and offset of the header applied."""
    with damaged(path, path.suffix[1:].lower()), laspy.open(path) as reader:
        header = reader.header
        promised = int(header.point_count)
        packed = header.are_points_compressed
        if not packed:
            room = path.stat().st_size - header.offset_to_point_data
            found = max(room, 0) // header.point_format.size
            if found < promised:
                raise WorldError(f"world file {path} is truncated: {promised} points promised, {found} found")
        if promised > MOST_POINTS:
            raise WorldError(
                f"world file {path} promises {promised} points, {MOST_POINTS:.3g} are allowed: thin it"
            )
        chunks = [
            np.stack([np.asarray(chunk.x), np.asarray(chunk.y), np.asarray(chunk.z)], axis=1)
            for chunk in reader.chunk_iterator(_CHUNK)
        ]
    points = np.concatenate([np.empty((0, 3)), *chunks])
    if len(points) != promised:
        raise WorldError(f"world file {path} is truncated: {promised} points promised, {len(points)} found")
    return base.cloud(path, f"{path.suffix[1:].lower()} cloud", points)

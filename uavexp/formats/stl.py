"""Stereolithography files (.stl), binary or text: triangles, whose equal corners become one vertex."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from uavexp.arrays import Float, Float32, Int
from uavexp.errors import WorldError
from uavexp.formats.base import Content, Options, mesh
from uavexp.formats.number_text import numbers

HEAD, FACET = 84, 50  # bytes before the facets, and of one
FACETS = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])


def read(path: Path, options: Options) -> Content:
    """Return the mesh of a file; raise `WorldError` when it is shorter than it promises."""
    data = path.read_bytes()
    facets = int.from_bytes(data[80:HEAD], "little") if len(data) >= HEAD else -1
    extra = len(data) - HEAD - FACET * facets
    warnings: tuple[str, ...] = ()
    if extra and re.match(rb"\s*solid\b", data, re.IGNORECASE) and re.search(rb"facet", data, re.IGNORECASE):
        corners = _text(path, data)
    elif facets < 0:
        raise WorldError(f"world file {path} is no stl file: it is shorter than a header")
    elif extra < 0:
        raise WorldError(
            f"world file {path} is truncated or no stl file: {len(data) - extra} bytes expected, "
            f"{len(data)} found"
        )
    else:
        corners = np.frombuffer(data, FACETS, facets, HEAD)["corners"].reshape(-1, 3)
        warnings = (f"{extra} bytes after its last facet were not read",) if extra else ()
    vertices, places = _welded(corners.astype(np.float32))
    return mesh(path, "stl mesh", vertices.astype(np.float64), places.reshape(-1, 3), warnings)


def _text(path: Path, data: bytes) -> Float:
    """Corners (3 F, 3) of a text."""
    rows = re.findall(rb"^[ \t]*vertex\s([^\r\n]*)", data, re.MULTILINE | re.IGNORECASE)
    facets = len(re.findall(rb"^[ \t]*facet\b", data, re.MULTILINE | re.IGNORECASE))
    corners = numbers(path, b" ".join(rows))
    if not re.search(rb"^[ \t]*endsolid\b[^\r\n]*\s*\Z", data, re.MULTILINE | re.IGNORECASE):
        raise WorldError(f"world file {path} is damaged or truncated: an ascii stl without its endsolid")
    if corners.size != 3 * len(rows) or len(rows) != 3 * facets:
        raise WorldError(
            f"world file {path} is damaged: {facets} facets need 3 vertices of 3 numbers each, "
            f"{len(rows)} with {corners.size} numbers were found"
        )
    return corners.reshape(-1, 3)


def _welded(points: Float32) -> tuple[Float32, Int]:
    """Different points (V, 3), and the place (N,) among them of each of the points (N, 3)."""
    points = points + np.float32(0.0)  # -0 is 0
    x, y, z = (points[:, axis].view(np.uint32).astype(np.uint64) for axis in range(3))
    mixed = (x * np.uint64(0x9E3779B97F4A7C15)) ^ (y * np.uint64(0xC2B2AE3D27D4EB4F)) ^ (z << np.uint64(16))
    _, first, places = np.unique(mixed, return_index=True, return_inverse=True)
    vertices = points[first]
    if not np.array_equal(vertices[places], points, equal_nan=True):  # two points of one mixture
        vertices, places = np.unique(points, axis=0, return_inverse=True)
    return vertices, places.reshape(-1)

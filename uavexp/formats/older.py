"""Files to triangles: meshes, point clouds, voxel sets. Every fault is one `WorldError` line.

Open3D answers a bad file with an empty or partial mesh and prints a warning of its own;
here the header is compared with what was read, and its printing is silenced.
"""

from __future__ import annotations

import os
import re
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from uavexp.arrays import Float, Int32
from uavexp.errors import WorldError
from uavexp.formats.base import Content, Options
from uavexp.o3d import open3d


def read(path: Path, options: Options) -> Content:
    """Return what a file holds."""
    suffix = path.suffix.lower()
    if suffix == ".ply" and not ply_counts(path)[1]:
        return Content(kind=f"{suffix[1:]} cloud", points=read_cloud(path))
    vertices, triangles = read_mesh(path)
    return Content(kind=f"{suffix[1:]} mesh", vertices=vertices, triangles=triangles)


def read_mesh(path: Path) -> tuple[Float, Int32]:
    """Return vertices (V, 3), in the file's unit, and triangles (F, 3) of a mesh file."""
    suffix = path.suffix.lower()
    if suffix == ".ply":
        promised = ply_counts(path)
    elif suffix == ".stl":
        promised = (0, _stl_faces(path))
    elif suffix == ".glb":
        promised = (0, _glb_check(path))
    else:
        promised = (0, _obj_faces(path))
    with _silence():
        mesh = open3d.io.read_triangle_mesh(str(path))
    vertices = np.asarray(mesh.vertices, dtype=np.float64)
    triangles = np.asarray(mesh.triangles, dtype=np.int32)
    if vertices.shape[0] < promised[0] or triangles.shape[0] < promised[1]:
        raise WorldError(
            f"world file {path} is damaged or truncated: {vertices.shape[0]} vertices and "
            f"{triangles.shape[0]} triangles could be read"
            + (f" of {promised[0]} and {promised[1]} promised" if promised[0] else "")
        )
    if triangles.shape[0] == 0:
        raise WorldError(f"world file {path} holds no triangles")
    if not np.isfinite(vertices).all():
        bad = int(np.count_nonzero(~np.isfinite(vertices).all(axis=1)))
        raise WorldError(f"world file {path} has {bad} vertices that are NaN or infinite")
    if triangles.min() < 0 or triangles.max() >= vertices.shape[0]:
        raise WorldError(
            f"world file {path} is damaged: a triangle names vertex {int(triangles.max())} of "
            f"{vertices.shape[0]}"
        )
    return vertices, triangles


def ply_counts(path: Path) -> tuple[int, int]:
    """Numbers of vertices and faces that a ply header promises."""
    head = path.read_bytes()[:65536]
    if not head.startswith(b"ply"):
        raise WorldError(f"world file {path} is no ply file: it does not begin with 'ply'")
    end = head.find(b"end_header")
    if end < 0:
        raise WorldError(f"world file {path} is damaged or truncated: its ply header has no end")
    counts = dict(re.findall(rb"element\s+(vertex|face)\s+(\d+)", head[:end]))
    return int(counts.get(b"vertex", 0)), int(counts.get(b"face", 0))


def _stl_faces(path: Path) -> int:
    size = path.stat().st_size
    with path.open("rb") as file:
        head = file.read(84)
    faces = int.from_bytes(head[80:84], "little") if len(head) == 84 else -1
    if faces >= 0 and size == 84 + 50 * faces:
        return faces
    text = path.read_bytes()
    if text.lstrip()[:5] == b"solid" and b"facet" in text:
        if b"endsolid" not in text:
            raise WorldError(f"world file {path} is damaged or truncated: an ascii stl without endsolid")
        return text.count(b"endfacet")
    if faces > 0 and size < 84 + 50 * faces:
        raise WorldError(
            f"world file {path} is truncated or no stl file: {84 + 50 * faces} bytes expected, {size} found"
        )
    raise WorldError(f"world file {path} is no stl file")


def _glb_check(path: Path) -> int:
    with path.open("rb") as file:
        head = file.read(12)
    if head[:4] != b"glTF" or len(head) < 12:
        raise WorldError(f"world file {path} is no glb file: it does not begin with 'glTF'")
    promised, size = int.from_bytes(head[8:12], "little"), path.stat().st_size
    if size < promised:
        raise WorldError(f"world file {path} is truncated: {promised} bytes expected, {size} found")
    return 0


def _obj_faces(path: Path) -> int:
    """Number of faces of an obj file, each of whose vertices and indices has been checked."""
    vertices = faces = 0
    for number, line in enumerate(path.read_bytes().split(b"\n"), start=1):
        words = line.split()
        if not words or words[0] not in (b"v", b"f"):
            continue
        where = f"world file {path}, line {number}"
        if words[0] == b"v":
            vertices += 1
            try:
                good = len(words) >= 4 and np.isfinite([float(word) for word in words[1:4]]).all()
            except ValueError:
                good = False
            if not good:
                raise WorldError(f"{where}: a vertex needs three finite numbers (truncated, NaN or no obj?)")
        else:
            faces += 1
            try:
                indices = [int(word.split(b"/")[0]) for word in words[1:]]
            except ValueError:
                indices = []
            if len(indices) < 3 or not all(1 <= abs(index) <= vertices for index in indices):
                raise WorldError(
                    f"{where}: a face needs three vertices of the {vertices} before it (truncated or no obj?)"
                )
    if faces == 0:
        raise WorldError(f"world file {path} holds no triangles")
    return faces


def read_cloud(path: Path) -> Float:
    """Return the points (N, 3) of a ply file, in the file's unit; invalid (NaN) ones dropped."""
    promised = ply_counts(path)[0]
    with _silence():
        cloud = open3d.io.read_point_cloud(str(path), remove_nan_points=False, remove_infinite_points=False)
    points = np.asarray(cloud.points, dtype=np.float64)
    if points.shape[0] < promised:
        raise WorldError(
            f"world file {path} is damaged or truncated: {points.shape[0]} points of {promised} could be read"
        )
    points = points[np.isfinite(points).all(axis=1)]
    if points.shape[0] == 0:
        raise WorldError(f"world file {path} holds no valid points")
    return points


@contextmanager
def _silence() -> Iterator[None]:
    """Keep what Open3D's C++ readers print off the terminal."""
    sys.stdout.flush()
    sys.stderr.flush()
    kept = os.dup(1), os.dup(2)
    try:
        with tempfile.TemporaryFile() as nowhere:
            os.dup2(nowhere.fileno(), 1)
            os.dup2(nowhere.fileno(), 2)
            yield
    finally:
        os.dup2(kept[0], 1)
        os.dup2(kept[1], 2)
        os.close(kept[0])
        os.close(kept[1])

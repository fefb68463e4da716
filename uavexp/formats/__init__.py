"""Files of buildings to what they hold: one module per format, found by the file's suffix.

Every fault is one `WorldError` line that names the file, the reason and what to do.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from uavexp.arrays import Float
from uavexp.formats import older, ros_map
from uavexp.formats.base import FREE, SOLID, UNMEASURED, Cells, Content, Options

__all__ = ["FREE", "READERS", "SOLID", "UNMEASURED", "Cells", "Content", "Options", "read"]


def read(path: Path, options: Options) -> Content:
    """Return what a file holds; raise `WorldError` in one line when it cannot be read whole."""
    older.check_file(path)
    return READERS[path.suffix.lower()](path, options)


def _mesh(path: Path, options: Options) -> Content:
    vertices, triangles = older.read_mesh(path)
    return Content(kind=f"{path.suffix[1:].lower()} mesh", vertices=vertices, triangles=triangles)


def _cloud(path: Path, options: Options) -> Content:
    return Content(kind=f"{path.suffix[1:].lower()} cloud", points=older.read_cloud(path))


def _ply(path: Path, options: Options) -> Content:
    return (_mesh if older.ply_counts(path)[1] else _cloud)(path, options)


def _npz(path: Path, options: Options) -> Content:
    voxels = older.read_voxels(path)
    return Content(kind="npz voxels", cells=_cells(voxels.occupied, voxels.free, voxels.resolution))


def _cells(occupied: Float, free: Float | None, size: float) -> Cells:
    """Cells of the centres (N, 3) of voxels; without measured free ones all others are free."""
    known = occupied if free is None else np.concatenate([occupied, free])
    corner = known.min(axis=0)
    shape = np.rint((known.max(axis=0) - corner) / size).astype(np.int64) + 1
    state = np.full(shape, FREE if free is None else UNMEASURED, dtype=np.uint8)
    if free is not None:
        state[tuple(np.rint((free - corner) / size).astype(np.int64).T)] = FREE
    state[tuple(np.rint((occupied - corner) / size).astype(np.int64).T)] = SOLID
    return Cells(state=state, origin=corner - 0.5 * size, size=np.full(3, size))


def _plan(path: Path, options: Options) -> Content:
    plan = ros_map.read(path)
    state = np.where(plan.occupied, SOLID, np.where(plan.unknown, UNMEASURED, FREE)).astype(np.uint8)
    return Content(
        kind="ROS map",
        cells=Cells(
            state=state[..., None],
            origin=np.array([*plan.origin_m, 0.0]),
            size=np.array([plan.resolution_m, plan.resolution_m, options.wall_height_m]),
            yaw_rad=plan.yaw_rad,
            is_plan=True,
        ),
    )


READERS: dict[str, Callable[[Path, Options], Content]] = {
    ".ply": _ply,
    ".obj": _mesh,
    ".stl": _mesh,
    ".glb": _mesh,
    ".pcd": _cloud,
    ".npz": _npz,
    ".yaml": _plan,
    ".yml": _plan,
}

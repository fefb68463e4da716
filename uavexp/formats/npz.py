"""Voxels or points as numpy arrays (`.npz`)."""

from __future__ import annotations

import zipfile
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.lib import format as npy

from uavexp.arrays import Float
from uavexp.errors import WorldError
from uavexp.formats import base, grid
from uavexp.formats.base import Cells, Content, Options
from uavexp.formats.guard import damaged

MOST_BYTES = 4 << 30  # of all arrays, unpacked
_KEYS = {
    "points", "points_m", "centres", "occupied", "free", "occupied_index", "free_index", "origin",
    "resolution", "size", "blocked",
}  # fmt: skip


def read(path: Path, options: Options) -> Content:
    """Return what the arrays hold.

    Keys: `points` or `points_m` (N, 3) of a cloud; `centres`, or `occupied` and `free`, of voxels of
    edge `resolution`; `occupied_index` and `free_index` with `origin` and `resolution` (centre = origin
    + (index + 0.5) * resolution); `size` (3,) and `blocked` (N, 3) cells of edge 1, the others free.
    What was measured free may be missing: then all but the occupied is free.
    """
    arrays = _arrays(path)
    if "blocked" in arrays and "size" in arrays:
        return Content(kind="npz voxels", cells=_blocked(path, arrays["size"], arrays["blocked"]))
    if "resolution" in arrays and arrays.keys() & {"centres", "occupied", "occupied_index"}:
        return Content(kind="npz voxels", cells=_voxels(path, arrays))
    points = next((arrays[key] for key in ("points", "points_m", "occupied") if key in arrays), None)
    if points is None:
        raise WorldError(
            f"world file {path} needs points, or centres, occupied or occupied_index with a resolution; "
            f"it has the keys {sorted(arrays)}"
        )
    return base.cloud(path, "npz cloud", _rows(path, "points", points))


def _arrays(path: Path) -> dict[str, Float]:
    with damaged(path, "npz"), zipfile.ZipFile(path) as archive:
        members = [info for info in archive.infolist() if info.filename.removesuffix(".npy") in _KEYS]
        unpacked = sum(info.file_size for info in members)
        if unpacked > MOST_BYTES:
            raise WorldError(
                f"world file {path} would unpack to {unpacked / 2**30:.1f} GiB, at most "
                f"{MOST_BYTES / 2**30:g} GiB are allowed: crop it"
            )
        arrays = {}
        for info in members:
            with archive.open(info) as member:
                arrays[info.filename.removesuffix(".npy")] = _array(path, member, info.file_size)
        if not arrays:
            names = [info.filename.removesuffix(".npy") for info in archive.infolist()][:20]
            raise WorldError(f"world file {path} needs points, centres or occupied; it has the keys {names}")
        return arrays


def _array(path: Path, member: IO[bytes], size: int) -> Float:
    """An array of a zip's member, of as many bytes as its own header says."""
    file: Any = member
    version = npy.read_magic(file)
    read_header = npy.read_array_header_1_0 if version == (1, 0) else npy.read_array_header_2_0
    shape, columns_first, kind = read_header(file)
    if kind.kind not in "fiub" or kind.itemsize > 8:
        raise WorldError(f"world file {path} is no npz file of numbers: it holds {kind}")
    data = file.read(size)
    if len(data) != kind.itemsize * int(np.prod(shape, dtype=object)):
        raise WorldError(f"world file {path} is damaged or truncated: an array of {shape} does not fit it")
    array = np.frombuffer(data, dtype=kind).reshape(shape, order="F" if columns_first else "C")
    return array.astype(np.float64)


def _rows(path: Path, name: str, array: Float) -> Float:
    if array.ndim != 2 or array.shape[1] != 3:
        raise WorldError(f"world file {path}: {name} must be (N, 3), got {array.shape}")
    return array


def _voxels(path: Path, arrays: dict[str, Float]) -> Cells:
    resolution = arrays["resolution"]
    if resolution.size != 1 or not 0.0 < float(resolution.flat[0]) < np.inf:
        raise WorldError(f"world file {path}: resolution must be one number > 0 and finite")
    size = float(resolution.flat[0])
    free: Float | None
    if "occupied_index" in arrays and arrays.get("origin", np.empty(0)).size == 3:
        origin = arrays["origin"].reshape(3)
        occupied = origin + (_rows(path, "occupied_index", arrays["occupied_index"]) + 0.5) * size
        free = arrays.get("free_index")
        free = None if free is None else origin + (_rows(path, "free_index", free) + 0.5) * size
    elif "occupied" in arrays or "centres" in arrays:
        occupied, free = arrays["occupied" if "occupied" in arrays else "centres"], arrays.get("free")
    else:
        raise WorldError(f"world file {path}: occupied_index needs an origin of three numbers")
    for name, centres in (("occupied voxels", occupied), ("free voxels", free)):
        if centres is not None and not np.isfinite(_rows(path, name, centres)).all():
            raise WorldError(f"world file {path} has {name} that are NaN or infinite")
    if not len(occupied):
        raise WorldError(f"world file {path} holds no occupied voxels")
    return grid.of_centres(path, occupied, free if free is not None and len(free) else None, size)


def _blocked(path: Path, size: Float, blocked: Float) -> Cells:
    if size.shape != (3,) or not (size >= 1).all() or not (size == np.floor(size)).all():
        raise WorldError(f"world file {path}: size must be 3 whole numbers >= 1")
    return grid.of_blocked(path, size, _rows(path, "blocked", blocked))

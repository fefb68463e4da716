"""Point clouds: files in, finite points out."""

from __future__ import annotations

import zipfile
from pathlib import Path

import numpy as np

from uavexp.arrays import Float
from uavexp.errors import UavexpError

_OPEN3D = (".ply", ".pcd", ".xyz", ".pts")


class CloudError(UavexpError):
    """A point cloud cannot be read or is too small for what is asked of it."""


def checked(points_m: Float) -> Float:
    """Return the points (N, 3) that are finite, as float64.

    Raises:
        CloudError: wrong shape, or none is left.
    """
    points = np.asarray(points_m)
    if points.ndim != 2 or points.shape[1] != 3 or points.dtype.kind not in "fiu":
        raise CloudError(f"a cloud must be numbers of shape (N, 3), got {points.dtype} {points.shape}")
    points = points.astype(np.float64, copy=False)
    finite = np.isfinite(points).all(axis=1)
    if not finite.all():
        points = points[finite]
    if not len(points):
        raise CloudError("the cloud has no finite point")
    return points


def read_cloud(path: Path) -> Float:
    """Points (N, 3), m, of a .ply, .pcd, .xyz or .pts file, or an .npz with `points` or `occupied`.

    Raises:
        CloudError: missing, damaged or empty.
    """
    if not path.is_file():
        raise CloudError(f"{path}: no such file")
    if path.suffix == ".npz":
        try:
            with np.load(path) as stored:
                name = next(name for name in ("points", "points_m", "occupied") if name in stored)
                points = np.asarray(stored[name])
        except (OSError, ValueError, EOFError, StopIteration, zipfile.BadZipFile):
            raise CloudError(f"{path}: no points or occupied (N, 3) in it") from None
    elif path.suffix in _OPEN3D:
        from uavexp.o3d import open3d

        points = np.asarray(open3d.io.read_point_cloud(str(path), remove_nan_points=True).points)
        if not len(points):  # Open3D reads a damaged file as an empty one
            raise CloudError(f"{path}: no point cloud in it")
    else:
        raise CloudError(f"{path}: a cloud is {', '.join(_OPEN3D)} or .npz")
    try:
        return checked(points)
    except CloudError as error:
        raise CloudError(f"{path}: {error}") from None

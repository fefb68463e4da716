"""Point clouds: files in, finite points out."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from uavexp import formats
from uavexp.arrays import Float
from uavexp.errors import UavexpError


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
    """Points (N, 3), in the file's unit, of any format of `uavexp.formats`.

    Of voxels the centres of the solid ones, of a mesh its vertices.

    Raises:
        WorldError: missing, damaged or of another format.
        CloudError: a plan, or nothing finite in it.
    """
    content = formats.read(path, formats.Options())
    if content.cells is None:
        points = content.points if len(content.points) else content.vertices
    elif content.cells.is_plan:
        raise CloudError(f"{path}: a {content.kind} is no cloud")
    else:
        index = np.argwhere(content.cells.state == formats.SOLID)
        points = content.cells.origin + (index + 0.5) * content.cells.size
    try:
        return checked(points)
    except CloudError as error:
        raise CloudError(f"{path}: {error}") from None

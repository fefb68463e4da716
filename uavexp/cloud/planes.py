"""The planes of a building by RANSAC, one after the other, seeded."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from uavexp.arrays import Float, Int32
from uavexp.o3d import open3d

_CHUNK = 500_000  # points judged at once
_UPRIGHT = np.sin(np.deg2rad(15.0))  # |n_z| of a wall is below this, of a floor above the cosine


class Plane(NamedTuple):
    """n · p + offset = 0."""

    normal: Float  # (3,) unit
    offset_m: float

    @property
    def is_vertical(self) -> bool:
        """A wall."""
        return bool(abs(self.normal[2]) < _UPRIGHT)

    @property
    def is_horizontal(self) -> bool:
        """A floor, ceiling or deck."""
        return bool(abs(self.normal[2]) > np.sqrt(1.0 - _UPRIGHT**2))


def fit_planes(
    points_m: Float,
    *,
    threshold_m: float,
    iterations: int,
    least_share: float,
    most_planes: int,
    sample: int,
    seed: int,
) -> tuple[Plane, ...]:
    """Planes of a cloud, the largest first.

    They are sought among an evenly spaced sample, so that memory and time do not grow with
    the cloud; who lies in them is asked of all points (`plane_of`).

    Args:
        points_m: (N, 3), finite.
        threshold_m: points this near to a plane lie in it.
        iterations: trials for each plane.
        least_share: of the sample that a plane must hold.
        most_planes: at which the search ends.
        sample: points that are looked at.
        seed: of the trials.
    """
    rest = points_m[:: max(1, len(points_m) // sample)]
    least = max(3, round(least_share * len(rest)))
    planes: list[Plane] = []
    open3d.utility.random.seed(seed)
    while len(planes) < most_planes and len(rest) >= least:
        cloud = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(rest))
        model, inside = cloud.segment_plane(threshold_m, 3, iterations)
        length = float(np.linalg.norm(model[:3]))
        if len(inside) < least or length == 0.0:
            break
        planes.append(Plane(np.asarray(model[:3]) / length, float(model[3]) / length))
        rest = np.delete(rest, inside, axis=0)
    return tuple(planes)


def plane_of(points_m: Float, planes: tuple[Plane, ...], threshold_m: float) -> Int32:
    """Number (N,) of the first plane that each point lies in, -1 for none."""
    number = np.full(len(points_m), -1, dtype=np.int32)
    for begin in range(0, len(points_m), _CHUNK):
        part, mine = points_m[begin : begin + _CHUNK], number[begin : begin + _CHUNK]
        for n, plane in enumerate(planes):
            mine[(mine < 0) & (np.abs(part @ plane.normal + plane.offset_m) <= threshold_m)] = n
    return number

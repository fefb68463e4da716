"""Cloud to voxel model: outliers, planes, voxels, traversability, with their counts (Liao et al., 3).

The paper's own counts do not agree with one another. The shell of its hall alone, 12.78 x 6.06 x
8.46 m, has about 526,000 voxels of 0.03 m where 69,917 are reported, more than its 129,964 points
could fill; 5,379 planar inliers are 4 % of them where 68 % are said to lie in planes.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from uavexp.arrays import Bool, Float
from uavexp.cloud.cloud_file import CloudError, checked
from uavexp.cloud.outliers import outliers
from uavexp.cloud.planes import Plane, fit_planes, plane_of
from uavexp.cloud.traversability import obstacles
from uavexp.cloud.voxels import CloudVoxels, voxelise
from uavexp.errors import require, require_positive

_LEAST_POINTS = 3  # a plane's


@dataclass(frozen=True, slots=True, kw_only=True)
class CloudCounts:
    """What the pipeline found, beside the paper's counts."""

    points: int  # finite ones that came in
    outliers: int
    planes: int
    planar_inliers: int
    planar_share: float  # of the points kept
    vertical_share: float  # of the points kept, in walls
    horizontal_share: float  # of the points kept, in floors and ceilings
    voxels: int  # non-empty
    obstacle_voxels: int  # not traversable
    specks: int  # voxels of groups that are too small
    dimensions_m: tuple[float, float, float]  # of the obstacles, between the outermost centroids
    deviation: tuple[float, float, float] | None  # from the true dimensions, relative; None without truth


class CloudModel(NamedTuple):
    """Answer of the pipeline."""

    voxels: CloudVoxels
    obstacle: Bool  # (V,)
    planes: tuple[Plane, ...]
    counts: CloudCounts


@dataclass(frozen=True, slots=True, kw_only=True)
class CloudPipeline:
    """Settings of the steps; the paper gives the edge of a voxel only."""

    voxel_size_m: float = 0.03
    neighbours: int = 20
    deviations: float = 2.0
    plane_threshold_m: float = 0.03
    plane_iterations: int = 1000
    least_plane_share: float = 0.01
    most_planes: int = 30
    plane_sample: int = 100_000
    least_voxels: int = 10
    seed: int = 0

    def __post_init__(self) -> None:
        require_positive(
            voxel_size_m=self.voxel_size_m,
            deviations=self.deviations,
            plane_threshold_m=self.plane_threshold_m,
        )
        share = self.least_plane_share
        require(0.0 < share <= 1.0, f"least_plane_share must be in (0, 1], got {share}")
        for name in ("neighbours", "plane_iterations", "most_planes", "plane_sample", "least_voxels"):
            require(getattr(self, name) >= 1, f"{name} must be >= 1, got {getattr(self, name)}")

    def run(self, points_m: Float, truth_m: tuple[float, float, float] | None = None) -> CloudModel:
        """Turn points (N, 3) into a voxel model.

        Args:
            points_m: any that are not finite are left out.
            truth_m: true dimensions, to compare with.

        Raises:
            CloudError: no finite point, or nothing that hangs together.
        """
        points = checked(points_m)
        if len(points) < _LEAST_POINTS:
            raise CloudError(f"a cloud needs at least {_LEAST_POINTS} finite points, got {len(points)}")
        outside = outliers(points, self.neighbours, self.deviations)
        kept = points[~outside]
        planes = fit_planes(
            kept,
            threshold_m=self.plane_threshold_m,
            iterations=self.plane_iterations,
            least_share=self.least_plane_share,
            most_planes=self.most_planes,
            sample=self.plane_sample,
            seed=self.seed,
        )
        number = plane_of(kept, planes, self.plane_threshold_m)
        voxels = voxelise(kept, self.voxel_size_m)
        obstacle = obstacles(voxels, self.least_voxels)
        if not obstacle.any():
            raise CloudError(
                f"no {self.least_voxels} voxels of {self.voxel_size_m:g} m hang together: larger ones?"
            )
        sides = np.ptp(voxels.centroid_m[obstacle], axis=0)
        upright = np.array([*(plane.is_vertical for plane in planes), False])
        level = np.array([*(plane.is_horizontal for plane in planes), False])
        x, y, z = (float(side) for side in sides)
        counts = CloudCounts(
            points=len(points),
            outliers=int(outside.sum()),
            planes=len(planes),
            planar_inliers=int((number >= 0).sum()),
            planar_share=float((number >= 0).mean()),
            vertical_share=float(upright[number].mean()),
            horizontal_share=float(level[number].mean()),
            voxels=len(voxels.key),
            obstacle_voxels=int(obstacle.sum()),
            specks=int((~obstacle).sum()),
            dimensions_m=(x, y, z),
            deviation=None if truth_m is None else _deviation((x, y, z), truth_m),
        )
        return CloudModel(voxels, obstacle, planes, counts)


def _deviation(
    have: tuple[float, float, float], truth: tuple[float, float, float]
) -> tuple[float, float, float]:
    require_positive(**{f"truth[{n}]_m": side for n, side in enumerate(truth)})
    x, y, z = (a / b - 1.0 for a, b in zip(have, truth, strict=True))
    return x, y, z

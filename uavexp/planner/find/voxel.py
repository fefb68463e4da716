"""Plain A*: the shortest 26-connected voxel path, exact (`voxels.canonical`).

This is what Liao et al. (paper 2) call the traditional method and do not define. It knows no
direction, no height and no distance beyond the least clearance.
"""

from __future__ import annotations

import numpy as np

from uavexp.arrays import Int
from uavexp.parameters import Count, option
from uavexp.planner.constraints import Constraints
from uavexp.planner.find.base import FoundPath
from uavexp.planner.find.voxels.live import find_among_voxels
from uavexp.planner.find.voxels.voxel_grid import VoxelGrid, VoxelPath
from uavexp.types import PlanRequest


@option
class Voxel:
    """Shortest voxel path at a clearance."""

    max_expansions: Count = 300_000  # cells that the search may expand
    spline: bool = False  # whether the key waypoints are joined by a quadratic spline, every part checked
    # (paper 2, 5.3)

    def find(self, request: PlanRequest, constraints: Constraints, rng: np.random.Generator) -> FoundPath:
        """Return the path, or why there is none (`Finder.find`); draws nothing."""
        del rng
        return find_among_voxels(request, constraints, self._shortest, self.spline)

    def _shortest(self, grid: VoxelGrid, start: Int, goal: Int) -> tuple[VoxelPath, str]:
        return grid.shortest(start, goal, self.max_expansions), ""

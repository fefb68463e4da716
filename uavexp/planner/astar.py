"""Plain A*: the shortest 26-connected voxel path, exact, flown as a minimum-acceleration curve.

This is what Liao et al. (paper 2) call the traditional method and do not define. It knows no
direction, no height and no distance beyond the least clearance; movers block it where they
are now ("current"), not where they will be. The search is `voxel.canonical`; path to
trajectory is that of `min_acc`, with its default weights, so that what is flown compares.

    python -m uavexp.planner.astar MAP.npz SCENARIOS.3dscen --limit 200

solves problems of the voxel path benchmark and compares their costs with the published ones.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass, field, replace

import numpy as np

from uavexp.arrays import Float, Int
from uavexp.errors import require, require_non_negative, require_positive
from uavexp.field import DistanceField
from uavexp.planner.find.grid import FoundPath
from uavexp.planner.find.voxel import live
from uavexp.planner.find.voxel.grid import VoxelGrid, VoxelPath
from uavexp.planner.min_acc import MinAcc
from uavexp.types import Limits, PlanRequest, PlanResult


@dataclass(slots=True, kw_only=True)
class Astar:
    """Shortest voxel path at a clearance, smoothed and timed as `min_acc` does."""

    min_clearance_m: float = 0.26
    z_band_m: float = 0.3
    unknown: str = "optimistic"
    max_expansions: int = 300_000
    spline: bool = False
    movers: str = "current"
    mover_margin_m: float = 0.5
    mover_horizon_s: float = 2.0
    _flight: MinAcc | None = field(default=None, init=False, repr=False)

    def __post_init__(self) -> None:
        require_positive(min_clearance_m=self.min_clearance_m)
        require_non_negative(z_band_m=self.z_band_m)
        require(
            self.movers in ("current", "predicted"),
            f"movers must be current or predicted, got {self.movers!r}",
        )
        self._shaped()  # checks what it is given

    def _shaped(self) -> MinAcc:
        return MinAcc(
            min_clearance_m=self.min_clearance_m,
            z_band_m=self.z_band_m,
            unknown=self.unknown,
            max_expansions=self.max_expansions,
            mover_margin_m=self.mover_margin_m,
            mover_horizon_s=self.mover_horizon_s,
        )

    def reset(self, limits: Limits, rng: np.random.Generator) -> None:
        """Begin a trial of a vehicle with these limits; draws nothing."""
        self._flight = self._shaped()
        self._flight.reset(limits, rng)

    def plan(self, request: PlanRequest) -> PlanResult:
        """Return a trajectory or the reason why there is none (`Planner.plan`)."""
        if self._flight is None:
            raise RuntimeError("plan() needs reset() first")
        if self.movers == "current":
            tracks = request.tracks
            standing = replace(tracks, velocity_mps=np.zeros_like(tracks.velocity_mps))
            request = replace(request, tracks=standing)
        return self._flight.plan_along(request, self)

    def find(self, field_: DistanceField, start_m: Float, goal_m: Float, bounds_m: Float) -> FoundPath:
        """Return the shortest path on the map (`search.Finder.find`)."""
        return live.find(
            field_, start_m, goal_m, bounds_m, self._shortest,
            min_clearance_m=self.min_clearance_m, z_band_m=self.z_band_m,
            known_only=self.unknown == "conservative", spline=self.spline,
        )  # fmt: skip

    def _shortest(self, grid: VoxelGrid, start: Int, goal: Int) -> tuple[VoxelPath, str]:
        return grid.shortest(start, goal, self.max_expansions), ""


if __name__ == "__main__":
    from uavexp.planner.find.voxel.benchmark import main

    sys.exit(main(sys.argv[1:]))

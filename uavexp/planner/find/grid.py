"""A* on the voxels of the live distance field, with an exact planar relaxation as heuristic.

26-connected; an edge costs its length times (1 + the mean penalty of its two cells), the
penalty being weight * ((safe - d)/(safe - min))² where the clearance d is below `safe`.
So the path keeps to the middle of a gap and takes a narrow one only when the way round is
longer. Cells below `min` are closed, except around a start that lies there itself.

Heuristic: a planar A* is run first, backward from the goal, on columns that are as good as
their best cell of the height band. With C the planar cost from start to goal and h_s, h_g
octile distances to start and goal, a column's bound is its exact planar cost when it was
closed, else max(h_g, C - h_s). This is consistent: for n closed and m not, g(n) + h_s(n)
<= C gives g(n) <= C - h_s(n) <= C - h_s(m) + c(n, m); for m closed and n not, n was opened
from m and never closed, so g(m) + c >= C - h_s(n). (The idea is adaptive A*'s; Koenig and
Likhachev 2006.) The result is optimal for the stated cost to one part in a million (the
inflation that breaks ties towards the goal).

Diagonal steps between free cells are taken as free when the clearance limit exceeds half
a voxel's diagonal, for then no point of the step comes closer to an obstacle than the
limit less that half diagonal; below it, every cell of the box moved through must be free.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from uavexp.arrays import Float, Int, UInt8
from uavexp.memory import blank
from uavexp.parameters import Count, NonNegative, option
from uavexp.planner.constraints import Constraints
from uavexp.planner.find.base import FoundPath
from uavexp.planner.find.column_path import CLIMB, over_columns
from uavexp.planner.find.ends import refusal
from uavexp.planner.find.grid_search import (
    BUDGET,
    FOUND,
    ClearanceRule,
    Nodes,
    Space,
    plan_cells,
    plan_columns,
    searched,
    trace,
)
from uavexp.types import PlanRequest, PlanStatus

_RESERVE_VOXELS = 0.25  # clearance of cells above the limit: for diagonal steps, and the curve's freedom


@dataclass(slots=True)
class _Memory:
    """Kept between searches; tells nothing of them."""

    generation: int = 0
    columns: Nodes = field(default_factory=lambda: _nodes(0))
    worth: Float = field(default_factory=lambda: np.empty(0))
    beyond: UInt8 = field(default_factory=lambda: np.empty(0, dtype=np.uint8))  # each column's next one
    cells: Nodes = field(default_factory=lambda: _nodes(0))
    parent: UInt8 = field(default_factory=lambda: np.empty(0, dtype=np.uint8))

    def fit(self, shape: Int) -> None:
        """Make room for a box of this shape (3,)."""
        columns, cells = int(shape[0] * shape[1]), int(shape.prod())
        if len(self.worth) < columns:
            self.columns, self.worth = _nodes(columns), np.empty(columns)
            self.beyond = np.empty(columns, dtype=np.uint8)
        if len(self.parent) < cells:
            self.cells, self.parent = _nodes(cells), blank(cells, np.uint8)

    def next(self) -> int:
        """Begin a search."""
        self.generation += 1
        return self.generation


def _nodes(size: int) -> Nodes:
    cost, key = (blank(size, np.float64) for _ in range(2))
    return Nodes(cost, key, *(blank(size, np.int32) for _ in range(3)))


@option
class Grid:
    """The path of least penalised length."""

    clearance_weight: NonNegative = 2.0  # 1, share by which a path of the least clearance counts as longer
    # [ours]
    slack: NonNegative = 0.05  # 1, share by which the path may cost more than the least: so much may be
    # lost by searching columns alone [ours]
    max_expansions: Count = 300_000  # cells that the search may expand
    _memory: _Memory = field(default_factory=_Memory, init=False, repr=False, compare=False)

    def find(self, request: PlanRequest, constraints: Constraints, rng: np.random.Generator) -> FoundPath:
        """Return the path, or why there is none (`Finder.find`); draws nothing."""
        del rng
        refused = refusal(request, constraints)
        if refused is not None:
            return refused
        space, memory = self._space(request, constraints), self._memory
        memory.fit(space.box[1] - space.box[0] + 1)
        columns = (memory.columns, memory.worth, memory.beyond)
        inflation = 1.0 + self.slack if space.cut_corners else 1.0
        status, planar_cost, expansions = plan_columns(space, memory.next(), inflation, *columns)
        if status != FOUND:
            return _no_path("start and goal are not joined at the clearance limit", expansions)
        cost, cells = np.inf, space.start[None]
        if space.cut_corners:
            cost, cells = over_columns(space, memory.beyond, expansions + 1)
        if cost > inflation * (planar_cost + CLIMB * abs(int(space.goal[2] - space.start[2]))):
            if inflation > 1.0:
                _, planar_cost, more = plan_columns(space, memory.next(), 1.0, *columns)
                expansions += more
            budget = (memory.generation, self.max_expansions)
            status, cost, more = plan_cells(
                space, *budget, planar_cost, memory.columns, memory.cells, memory.parent
            )
            expansions += more
            if status == BUDGET:
                return _no_path(f"not found in {self.max_expansions} expansions", expansions)
            if status != FOUND:
                return _no_path("start and goal are not joined in the height band", expansions)
            cells = trace(space, memory.parent, more + 1)
        voxel_m = request.field.voxel_size_m
        path_m = request.field.origin_m + (cells + 0.5) * voxel_m
        path_m = np.concatenate([request.position_m[None], path_m[1:-1], request.goal.position_m[None]])
        return FoundPath(status=PlanStatus.OK, path_m=path_m, cost=cost * voxel_m, expansions=expansions)

    def _space(self, request: PlanRequest, constraints: Constraints) -> Space:
        """The voxels of the flight bounds within the height band, and what they are worth."""
        map_, start_m, goal_m = request.field, request.position_m, request.goal.position_m
        grid = (map_.origin_m, map_.voxel_size_m, np.array(map_.distance.shape))
        box, start, goal = searched(*grid, start_m, goal_m, request.flight_bounds_m, constraints.z_band_m)
        here_m = min(float(map_.distance_m(start_m[None])[0]), float(map_.distance[tuple(start)]))
        least_m = constraints.min_clearance_m + _RESERVE_VOXELS * map_.voxel_size_m
        spread, missing = constraints.safe_clearance_m - least_m, max(least_m - here_m, 0.0)
        rule = ClearanceRule(
            least_m,
            constraints.safe_clearance_m,
            1.0 / spread if spread > 0.0 else 0.0,
            self.clearance_weight,
            here_m,
            (2.0 * missing / map_.voxel_size_m + 3.0) ** 2 if missing > 0.0 else -1.0,
        )
        cut_corners = bool(constraints.min_clearance_m >= 0.5 * np.sqrt(3.0) * map_.voxel_size_m)
        return Space(map_.distance, map_.state, constraints.known_only, cut_corners, rule, box, start, goal)


def _no_path(reason: str, expansions: int) -> FoundPath:
    return FoundPath(status=PlanStatus.NO_PATH, reason=reason, expansions=expansions)

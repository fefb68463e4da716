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
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Protocol

import numba as nb
import numpy as np

from uavexp.arrays import Float, Float32, Int, Int32, UInt8
from uavexp.field import DistanceField
from uavexp.planner.find.heap import pop, sift_up
from uavexp.types import PlanStatus

_CLOSED, _BLOCKED, _SEEN = -1, -2, -3  # what `place` says of a cell that is not in the heap
_TIE = 1.0 + 1e-6  # inflation of the heuristic: prefers the deeper of equal nodes
_BELOW_LIMIT = 20.0  # extra penalty of a cell below the limit, next to a start that is there too
_STEPS = np.array(
    [(i, j, k) for i in (-1, 0, 1) for j in (-1, 0, 1) for k in (-1, 0, 1) if (i, j, k) != (0, 0, 0)],
    dtype=np.int64,
)
_LENGTHS = np.sqrt((_STEPS**2).sum(axis=1).astype(np.float64))

_RESERVE_VOXELS = 0.25  # clearance of cells above the limit: for diagonal steps, and the curve's freedom
_FOUND, _NO_PATH, _BUDGET = 0, 1, 2


@nb.njit(cache=True, inline="always")
def _octile_2d(di: int, dj: int) -> float:
    a, b = abs(di), abs(dj)
    return max(a, b) + 0.41421356237309503 * min(a, b)


@nb.njit(cache=True, inline="always")
def _octile_3d(di: int, dj: int, dk: int) -> float:
    a, b, c = abs(di), abs(dj), abs(dk)
    least, most = min(a, b, c), max(a, b, c)
    middle = a + b + c - least - most
    return most + 0.41421356237309503 * middle + 0.3178372451957822 * least


@nb.njit(cache=True, inline="always")
def _penalty(clearance: float, rule: Float) -> float:
    """Share by which a cell of this clearance lengthens the way through it; rule: see `_rule`."""
    if clearance >= rule[1]:
        return 0.0
    short = min((rule[1] - clearance) * rule[2], 10.0)  # an unknown start has no clearance at all
    penalty = rule[3] * short * short
    return float(penalty + _BELOW_LIMIT if clearance < rule[0] else penalty)


@nb.njit(cache=True, inline="always")
def _limit(rule: Float, distance_voxels_squared: float) -> float:
    """Least clearance of a passable cell at this squared distance from the start."""
    return float(min(rule[0], rule[4]) if distance_voxels_squared <= rule[5] else rule[0])


@nb.njit(cache=True)
def _clearance(
    distance: Float32, state: UInt8, known_only: bool, rule: Float, i: int, j: int, k: int
) -> float:
    """Clearance of a cell; where unknown is closed: none in it, and the least allowed next to it."""
    here = float(distance[i, j, k])
    if not known_only:
        return here
    if state[i, j, k] == 0:
        return -np.inf
    for axis in range(3):
        for side in (-1, 1):
            ni = min(max(i + (side if axis == 0 else 0), 0), state.shape[0] - 1)
            nj = min(max(j + (side if axis == 1 else 0), 0), state.shape[1] - 1)
            nk = min(max(k + (side if axis == 2 else 0), 0), state.shape[2] - 1)
            if state[ni, nj, nk] == 0:
                return float(min(here, rule[0]))
    return here


@nb.njit(cache=True)
def _plan_columns(
    distance: Float32,
    state: UInt8,
    known_only: bool,
    box: Int,
    start: Int,
    goal: Int,
    rule: Float,
    generation: int,
    cost: Float,
    key: Float,
    clearance: Float32,
    stamp: Int32,
    place: Int32,
    heap: Int32,
) -> tuple[int, float, int]:
    """Backward planar A* over columns; returns status, cost in voxels and expansions."""
    i0, j0, k0, i1, j1, k1 = box[0, 0], box[0, 1], box[0, 2], box[1, 0], box[1, 1], box[1, 2]
    nj = j1 - j0 + 1
    source = (goal[0] - i0) * nj + goal[1] - j0
    target = (start[0] - i0) * nj + start[1] - j0
    stamp[source] = generation
    cost[source] = 0.0
    key[source] = _octile_2d(goal[0] - start[0], goal[1] - start[1])
    best = -np.inf
    for k in range(k0, k1 + 1):
        best = max(best, _clearance(distance, state, known_only, rule, goal[0], goal[1], k))
    clearance[source] = best
    heap[0] = source
    place[source] = 0
    size, expansions = 1, 0
    while size > 0:
        cell = pop(heap, place, key, size)
        size -= 1
        expansions += 1
        if cell == target:
            return _FOUND, cost[cell], expansions
        ci, cj = cell // nj + i0, cell % nj + j0
        here = _penalty(clearance[cell], rule)
        for di in range(-1, 2):
            for dj in range(-1, 2):
                i, j = ci + di, cj + dj
                if (di == 0 and dj == 0) or i < i0 or i > i1 or j < j0 or j > j1:
                    continue
                other = (i - i0) * nj + j - j0
                if stamp[other] != generation:
                    best = -np.inf
                    for k in range(k0, k1 + 1):
                        best = max(best, _clearance(distance, state, known_only, rule, i, j, k))
                    apart = float((i - start[0]) ** 2 + (j - start[1]) ** 2)
                    stamp[other] = generation
                    clearance[other] = best
                    cost[other] = np.inf
                    place[other] = _BLOCKED if best < _limit(rule, apart) and other != target else _SEEN
                if place[other] == _CLOSED or place[other] == _BLOCKED:
                    continue
                step = 1.4142135623730951 if di != 0 and dj != 0 else 1.0
                there = cost[cell] + step * (1.0 + 0.5 * (here + _penalty(clearance[other], rule)))
                if there < cost[other]:
                    if place[other] == _SEEN:
                        heap[size] = other
                        place[other] = size
                        size += 1
                    cost[other] = there
                    key[other] = there + _octile_2d(i - start[0], j - start[1])
                    sift_up(heap, place, key, place[other])
    return _NO_PATH, np.inf, expansions


@nb.njit(cache=True)
def _plan_cells(
    distance: Float32,
    state: UInt8,
    known_only: bool,
    cut_corners: bool,
    box: Int,
    start: Int,
    goal: Int,
    rule: Float,
    generation: int,
    max_expansions: int,
    planar_total: float,
    planar_cost: Float,
    planar_stamp: Int32,
    planar_place: Int32,
    cost: Float,
    key: Float,
    parent: UInt8,
    stamp: Int32,
    place: Int32,
    heap: Int32,
) -> tuple[int, float, int]:
    """Forward A* over cells; returns status, cost in voxels and expansions."""
    i0, j0, k0, i1, j1, k1 = box[0, 0], box[0, 1], box[0, 2], box[1, 0], box[1, 1], box[1, 2]
    nj, nk = j1 - j0 + 1, k1 - k0 + 1
    source = ((start[0] - i0) * nj + start[1] - j0) * nk + start[2] - k0
    target = ((goal[0] - i0) * nj + goal[1] - j0) * nk + goal[2] - k0
    stamp[source] = generation
    cost[source] = 0.0
    key[source] = 0.0
    heap[0] = source
    place[source] = 0
    size, expansions = 1, 0
    while size > 0:
        cell = pop(heap, place, key, size)
        size -= 1
        if cell == target:
            return _FOUND, cost[cell], expansions
        if expansions >= max_expansions:
            return _BUDGET, np.inf, expansions
        expansions += 1
        ck = cell % nk + k0
        cj = (cell // nk) % nj + j0
        ci = cell // (nk * nj) + i0
        here = _penalty(_clearance(distance, state, known_only, rule, ci, cj, ck), rule)
        for n in range(26):
            i, j, k = ci + _STEPS[n, 0], cj + _STEPS[n, 1], ck + _STEPS[n, 2]
            if i < i0 or i > i1 or j < j0 or j > j1 or k < k0 or k > k1:
                continue
            other = ((i - i0) * nj + j - j0) * nk + k - k0
            clearance = _clearance(distance, state, known_only, rule, i, j, k)
            if stamp[other] != generation:
                apart = float((i - start[0]) ** 2 + (j - start[1]) ** 2 + (k - start[2]) ** 2)
                stamp[other] = generation
                cost[other] = np.inf
                place[other] = _BLOCKED if clearance < _limit(rule, apart) and other != target else _SEEN
            if place[other] == _CLOSED or place[other] == _BLOCKED:
                continue
            if not cut_corners and _cuts_corner(distance, state, known_only, rule, ci, cj, ck, n):
                continue
            there = cost[cell] + _LENGTHS[n] * (1.0 + 0.5 * (here + _penalty(clearance, rule)))
            if there < cost[other]:
                column = (i - i0) * nj + j - j0
                bound = _octile_3d(i - goal[0], j - goal[1], k - goal[2])
                if planar_stamp[column] == generation and planar_place[column] == _CLOSED:
                    bound = max(bound, planar_cost[column])
                else:
                    bound = max(bound, planar_total - _octile_2d(i - start[0], j - start[1]))
                if place[other] == _SEEN:
                    heap[size] = other
                    place[other] = size
                    size += 1
                cost[other] = there
                parent[other] = n
                key[other] = there + _TIE * bound
                sift_up(heap, place, key, place[other])
    return _NO_PATH, np.inf, expansions


@nb.njit(cache=True, inline="always")
def _cuts_corner(
    distance: Float32, state: UInt8, known_only: bool, rule: Float, i: int, j: int, k: int, n: int
) -> bool:
    """Whether a cell of the box that the step moves through is blocked."""
    for a in range(2):
        for b in range(2):
            for c in range(2):
                at_i, at_j, at_k = i + a * _STEPS[n, 0], j + b * _STEPS[n, 1], k + c * _STEPS[n, 2]
                if _clearance(distance, state, known_only, rule, at_i, at_j, at_k) < rule[0]:
                    return True
    return False


@dataclass(frozen=True, slots=True, kw_only=True)
class FoundPath:
    """Answer of a search."""

    status: PlanStatus  # OK, START_BLOCKED, GOAL_BLOCKED or NO_PATH
    path_m: Float  # (P, 3) from the exact start to the exact goal; empty unless OK
    cost_m: float  # penalised length from the start's voxel to the goal's; inf unless OK
    expansions: int  # of columns and of cells
    reason: str = ""


class Finder(Protocol):
    """Anything that finds a path on a distance field."""

    def find(self, field_: DistanceField, start_m: Float, goal_m: Float, bounds_m: Float) -> FoundPath:
        """Return a path from start (3,) to goal (3,) within the bounds (2, 3), or why there is none."""
        ...


@dataclass(slots=True, kw_only=True)
class PathSearch:
    """A* from start to goal on a distance field; buffers are kept between calls.

    Diagonal steps between free cells are taken as free when the clearance limit exceeds half
    a voxel's diagonal, for then no point of the step comes closer to an obstacle than the
    limit less that half diagonal; below it, every cell of the box moved through must be free.
    """

    min_clearance_m: float
    safe_clearance_m: float
    clearance_weight: float
    z_band_m: float  # cells further above or below both start and goal are not used
    known_only: bool  # unknown cells are blocked
    max_expansions: int
    _generation: int = field(default=0, init=False, repr=False)
    _cells: tuple[Float, Float, UInt8, Int32, Int32, Int32] = field(
        default_factory=lambda: _cell_buffers(0), init=False, repr=False
    )
    _columns: tuple[Float, Float, Float32, Int32, Int32, Int32] = field(
        default_factory=lambda: _column_buffers(0), init=False, repr=False
    )

    def find(self, field_: DistanceField, start_m: Float, goal_m: Float, bounds_m: Float) -> FoundPath:
        """Return the path of least penalised length.

        Args:
            field_: the map.
            start_m: (3,).
            goal_m: (3,).
            bounds_m: (2, 3) box that the path may not leave.
        """
        here, there = field_.distance_m(np.stack([start_m, goal_m]))
        if here <= 0.0:
            return _failed(PlanStatus.START_BLOCKED, f"the start lies {-here:.2f} m inside an obstacle")
        if there < self.min_clearance_m or np.any(goal_m < bounds_m[0]) or np.any(goal_m > bounds_m[1]):
            return _failed(
                PlanStatus.GOAL_BLOCKED, f"the goal's clearance is {there:.2f} m, or it is outside"
            )
        box = self._box(field_, start_m, goal_m, bounds_m)
        start = np.clip(_voxel(field_, start_m), box[0], box[1])
        goal = np.clip(_voxel(field_, goal_m), box[0], box[1])
        if self.known_only and field_.state[tuple(goal)] == 0:
            return _failed(PlanStatus.GOAL_BLOCKED, "the goal's voxel is unknown")
        rule = self._rule(min(float(here), float(field_.distance[tuple(start)])), field_.voxel_size_m)
        return self._run(field_, box, (start, goal), rule, np.stack([start_m, goal_m]))

    def _box(self, field_: DistanceField, start_m: Float, goal_m: Float, bounds_m: Float) -> Int:
        """First and last voxel (2, 3) of the flight bounds within the height band."""
        low, high = bounds_m[0].copy(), bounds_m[1].copy()
        low[2] = max(low[2], min(start_m[2], goal_m[2]) - self.z_band_m)
        high[2] = min(high[2], max(start_m[2], goal_m[2]) + self.z_band_m)
        size, last = field_.voxel_size_m, np.array(field_.distance.shape) - 1
        first = np.ceil((low - field_.origin_m) / size - 0.5 - 1e-9)
        final = np.floor((high - field_.origin_m) / size - 0.5 + 1e-9)
        goal = _voxel(field_, goal_m)  # a bound narrower than a voxel still holds the goal's
        box = np.stack([np.minimum(first, goal), np.maximum(final, goal)]).astype(np.int64)
        return np.clip(box, 0, last)

    def _rule(self, start_clearance_m: float, voxel_m: float) -> Float:
        """Numbers the kernels read: min, safe, 1/(safe - min), weight, start's limit, its reach²."""
        least = self.min_clearance_m + _RESERVE_VOXELS * voxel_m
        spread = self.safe_clearance_m - least
        missing = max(least - start_clearance_m, 0.0)
        reach = (2.0 * missing / voxel_m + 3.0) ** 2 if missing > 0.0 else -1.0
        scale = 1.0 / spread if spread > 0.0 else 0.0
        numbers = [least, self.safe_clearance_m, scale, self.clearance_weight]
        return np.array([*numbers, start_clearance_m, reach])

    def _run(
        self, field_: DistanceField, box: Int, ends: tuple[Int, Int], rule: Float, ends_m: Float
    ) -> FoundPath:
        shape = box[1] - box[0] + 1
        if self._columns[0].size < shape[0] * shape[1]:
            self._columns = _column_buffers(int(shape[0] * shape[1]))
        if self._cells[0].size < shape.prod():
            self._cells = _cell_buffers(int(shape.prod()))
        self._generation += 1
        common = (box, *ends, rule, self._generation)
        known = (field_.distance, field_.state, self.known_only)
        status, total, planar_expansions = _plan_columns(*known, *common, *self._columns)
        if status != _FOUND:
            return _failed(
                PlanStatus.NO_PATH, "start and goal are not joined at the clearance limit", planar_expansions
            )
        cut_corners = self.min_clearance_m >= 0.5 * np.sqrt(3.0) * field_.voxel_size_m
        planar = (total, self._columns[0], self._columns[3], self._columns[4])
        status, cost, expansions = _plan_cells(
            *known, cut_corners, *common, self.max_expansions, *planar, *self._cells
        )
        expansions += planar_expansions
        if status == _BUDGET:
            return _failed(PlanStatus.NO_PATH, f"not found in {self.max_expansions} expansions", expansions)
        if status != _FOUND:
            return _failed(PlanStatus.NO_PATH, "start and goal are not joined in the height band", expansions)
        steps = self._trace(box, ends)
        path = field_.origin_m + (steps + 0.5) * field_.voxel_size_m
        path = np.concatenate([ends_m[:1], path[1:-1], ends_m[1:]])
        return FoundPath(
            status=PlanStatus.OK, path_m=path, cost_m=cost * field_.voxel_size_m, expansions=expansions
        )

    def _trace(self, box: Int, ends: tuple[Int, Int]) -> Int:
        """Voxels (P, 3) from start to goal, by the parents that the search left."""
        parent = self._cells[2]
        shape = box[1] - box[0] + 1
        start, cell = ends[0] - box[0], ends[1] - box[0]
        steps = [cell]
        while not np.array_equal(cell, start):
            cell = cell - _STEPS[parent[(cell[0] * shape[1] + cell[1]) * shape[2] + cell[2]]]
            steps.append(cell)
        return np.asarray(np.array(steps[::-1]) + box[0])


def _voxel(field_: DistanceField, point_m: Float) -> Int:
    index = np.floor((point_m - field_.origin_m) / field_.voxel_size_m).astype(np.int64)
    return np.clip(index, 0, np.array(field_.distance.shape) - 1)


def _failed(status: PlanStatus, reason: str, expansions: int = 0) -> FoundPath:
    return FoundPath(
        status=status, path_m=np.zeros((0, 3)), cost_m=np.inf, expansions=expansions, reason=reason
    )


def _cell_buffers(size: int) -> tuple[Float, Float, UInt8, Int32, Int32, Int32]:
    """Cost, key, parent step, stamp, place in the heap, heap."""
    stamp, place = np.zeros(size, dtype=np.int32), np.empty(size, dtype=np.int32)
    heap = np.empty(size, dtype=np.int32)
    return np.empty(size), np.empty(size), np.empty(size, dtype=np.uint8), stamp, place, heap


def _column_buffers(size: int) -> tuple[Float, Float, Float32, Int32, Int32, Int32]:
    """Cost, key, best clearance, stamp, place in the heap, heap."""
    stamp, place = np.zeros(size, dtype=np.int32), np.empty(size, dtype=np.int32)
    heap = np.empty(size, dtype=np.int32)
    return np.empty(size), np.empty(size), np.empty(size, dtype=np.float32), stamp, place, heap

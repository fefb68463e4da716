"""What a choice of a goal sees: the planar map, its frontier, where the body fits, and ways over it.

All of it is kept from one choice to the next and brought up to date where the map has changed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from uavexp.arrays import Bool, Float, Int, Int32, UInt8
from uavexp.explorer.planar import mark_frontier
from uavexp.explorer.waves import (
    DIAGONAL,
    FAR,
    STRAIGHT,
    WALL_LEVELS,
    Wave,
    begin,
    forget,
    mark_kinds,
    new_wave,
    reach,
    way_back,
)
from uavexp.field import FREE, DistanceField
from uavexp.mapping.projection import Band, Part, PlanarMap, Projection

Cell = tuple[int, int]


def prices(unknown: float, occupied: float, at_wall: float | None = None) -> Int32:
    """What cells of each kind cost; a free one is the unit, 0: no way leads over them.

    Args:
        unknown: far from any wall that was seen.
        occupied: nearer to an obstacle than a free cell.
        at_wall: unknown at such a wall, less farther from it; None: as elsewhere.
    """
    share = (np.arange(WALL_LEVELS) + 0.5) / WALL_LEVELS
    near = unknown + (1.0 - share) * ((unknown if at_wall is None else at_wall) - unknown)
    price: Int32 = np.rint(STRAIGHT * np.array([0.0, unknown, 1.0, occupied, *near])).astype(np.int32)
    return price


KNOWN = prices(unknown=0.0, occupied=0.0)
_OPTIMISTIC = prices(unknown=1.0, occupied=1.0)


class Plane:
    """The planar map of one field and its frontier.

    Args:
        field: the map.
        band: what of it is projected.
        bounds_m: (2, 3) of the flight.
    """

    __slots__ = ("_projection", "frontier", "inside", "map")

    def __init__(self, field: DistanceField, band: Band, bounds_m: Float) -> None:
        self._projection = Projection(field, band)
        self.map: PlanarMap = self._projection.planar
        rows, columns = (_within(self.map, axis, bounds_m[:, axis]) for axis in range(2))
        self.inside: Part = (*rows, *columns)
        self.frontier: Bool = np.zeros(self.map.state.shape, dtype=np.bool_)

    @property
    def field(self) -> DistanceField:
        """The map."""
        return self._projection.field

    def update(self) -> Int:
        """Bring it up to date; returns the parts (P, 4) that were."""
        parts = self._projection.update()
        mark_frontier(self.map.state, self.inside, parts, self.frontier)
        return parts

    def cells_of(self, points_m: Float) -> Int:
        """Cells (N, 2) that hold points (N, 3); the nearest ones of those outside."""
        index = np.floor((points_m[:, :2] - self.map.origin_m) / self.map.cell_m).astype(np.int64)
        return np.asarray(np.clip(index, 0, np.array(self.map.state.shape) - 1))


def _within(planar: PlanarMap, axis: int, bounds_m: Float) -> tuple[int, int]:
    """First row (or column) whose centre lies within bounds (2,), and the one behind the last."""
    centre_m = planar.origin_m[axis] + (np.arange(planar.state.shape[axis]) + 0.5) * planar.cell_m
    within = np.flatnonzero((centre_m >= bounds_m[0]) & (centre_m <= bounds_m[1]))
    return (int(within[0]), int(within[-1]) + 1) if within.size else (0, 0)


@dataclass(slots=True, kw_only=True)
class Passage:
    """Where a body passes on a plane, and the costs of ways there from the vehicle and from the target."""

    plane: Plane
    clearance_m: float  # that passable cells exceed ...
    escape_m: (
        float  # ... but for so far around the vehicle: too near to an obstacle, it must find its way out
    )
    target: Cell | None
    wall_m: float = 0.0  # unknown cells so near to an obstacle have prices of their own
    target_price: Int32 = field(default_factory=_OPTIMISTIC.copy)  # of each kind on ways to the target
    vehicle: Cell = (0, 0)
    closed: Bool = field(init=False)  # (X, Y) cells that no way may lead over, whatever is known of them
    _parts: list[Int] = field(default_factory=list)  # of the plane that changed and were not looked at yet
    _kind: UInt8 = field(init=False)  # ((X + 2) (Y + 2),) not passable, unknown, free, occupied
    _price: Int32 = field(init=False)  # of each kind on ways from the vehicle
    _from_vehicle: Wave = field(init=False)
    _from_target: Wave = field(init=False)

    def __post_init__(self) -> None:
        rows, columns = self.plane.map.state.shape
        size = (rows + 2) * (columns + 2)
        self._kind = np.zeros(size, dtype=np.uint8)
        self.closed = np.zeros((rows, columns), dtype=np.bool_)
        self._from_vehicle, self._from_target = new_wave(size), new_wave(size)
        self._parts = [np.array([[0, rows, 0, columns]])]
        if self.target is not None:
            begin(self._from_target, self._flat(self.target), STRAIGHT)

    def note(self, parts: Int) -> None:
        """Take note of parts (P, 4) of the plane that changed."""
        self._parts.append(parts)

    def update(self, vehicle: Cell) -> None:
        """Bring it up to date, with the vehicle in this cell."""
        reach_cells = self.escape_m / self.plane.map.cell_m
        around = [
            _around(cell, int(reach_cells), self.plane.map.state.shape) for cell in (self.vehicle, vehicle)
        ]
        self.vehicle = vehicle
        level = mark_kinds(
            self.plane.map.state, self.plane.map.clearance, np.concatenate([*self._parts, np.array(around)]),
            self.plane.inside, np.float32(self.clearance_m), np.float32(self.wall_m), self.closed, vehicle,
            reach_cells**2, self._kind, self.target_price, self._from_target,
        )  # fmt: skip
        self._parts.clear()
        if level < FAR - 1:
            forget(self._from_target, level, math.ceil(math.sqrt(2.0) * int(self.target_price.max())))

    def begin(self, price: Int32) -> None:
        """Ask for ways from the vehicle over cells of these prices."""
        own = price[1 + self.plane.map.state[self.vehicle]] or STRAIGHT
        self._price = price
        begin(self._from_vehicle, self._flat(self.vehicle), own)

    def from_vehicle(self, cell: Cell, most: float = np.inf) -> float:
        """Cost of the way to a cell, in cells; inf when there is none up to `most`."""
        return self._cost(self._from_vehicle, self._price, cell, most)

    def from_target(self, cell: Cell, most: float = np.inf) -> float:
        """The same from the target, over cells of the prices to it; 0 without a target."""
        return 0.0 if self.target is None else self._cost(self._from_target, self.target_price, cell, most)

    def way_to_target(self, cell: Cell) -> Int:
        """Cells (N, 2) of the least way from one to the target, both included; none when there is no way."""
        start = self._flat(cell)
        if self.from_target(cell) == np.inf:
            return np.zeros((0, 2), dtype=np.int64)
        flat = way_back(self._from_target, self._kind, self._width, self.target_price, start)
        return np.column_stack(np.divmod(flat.astype(np.int64), self._width)) - 1

    def close(self, cells: list[Cell], radius_cells: float) -> None:
        """Close all cells so near to these, and no others."""
        i, j = np.ogrid[: self.closed.shape[0], : self.closed.shape[1]]
        closed = np.zeros_like(self.closed)
        for cell in cells:
            closed |= (i - cell[0]) ** 2 + (j - cell[1]) ** 2 <= radius_cells**2
        changed = np.argwhere(closed != self.closed)
        if len(changed):
            low, high = changed.min(axis=0), changed.max(axis=0) + 1
            self._parts.append(np.array([[low[0], high[0], low[1], high[1]]]))
        self.closed = closed

    def knows_a_way(self, cell: Cell) -> bool:
        """Whether cells known to be free lead from the vehicle to this one."""
        if self._kind[self._flat(cell)] != 1 + FREE:
            return False
        self.begin(KNOWN)
        return self.from_vehicle(cell) < np.inf

    def _cost(self, wave: Wave, price: Int32, cell: Cell, most: float) -> float:
        limit = int(min(STRAIGHT * most + 1.0, FAR))
        cost = reach(wave, self._kind, self._width, price, self._flat(cell), limit)
        return float(np.float32(cost / STRAIGHT)) if cost < FAR else np.inf

    @property
    def _width(self) -> int:
        """Cells in a row, with the margin."""
        return int(self.plane.map.state.shape[1]) + 2

    def _flat(self, cell: Cell) -> int:
        """Where a cell stands in a wave."""
        return (cell[0] + 1) * self._width + cell[1] + 1


def _around(cell: Cell, reach: int, shape: tuple[int, ...]) -> list[int]:
    """The part of the plane so far around a cell."""
    (i, j), (rows, columns) = cell, shape
    return [max(i - reach, 0), min(i + reach + 1, rows), max(j - reach, 0), min(j + reach + 1, columns)]


def straight(cells: Int, to: Cell) -> Float:
    """Cost (N,) of the way from cells (N, 2) to another if nothing stood between, in cells."""
    apart = np.abs(cells - np.array(to))
    longer, shorter = apart.max(axis=1), apart.min(axis=1)
    cost = STRAIGHT * (longer - shorter) + DIAGONAL * shorter
    return np.asarray((cost / STRAIGHT).astype(np.float32), dtype=np.float64)

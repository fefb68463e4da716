"""A voxel grid made ready for searches."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from uavexp.arrays import Bool, Float, Int, Int32
from uavexp.planner.find.voxels import canonical
from uavexp.planner.find.voxels.directed import COUNT_MADE, RULE_OR, find_directed
from uavexp.planner.find.voxels.jump import Terrain, survey
from uavexp.planner.find.voxels.moves import LENGTHS, STEPS

NO_LIMIT = 1 << 60


class VoxelPath(NamedTuple):
    """Answer of a search."""

    status: int  # canonical.FOUND, NO_PATH or BUDGET
    cost: float  # of the search's own objective, voxels; inf unless found
    cells: Int32  # (P, 3) start to goal; empty unless found
    expansions: int

    @property
    def centres(self) -> Float:
        """Centres (P, 3) of the cells, in voxels from the grid's corner."""
        return np.asarray(self.cells + 0.5, dtype=np.float64)

    @property
    def found(self) -> bool:
        """Whether there is a path."""
        return self.status == canonical.FOUND


class Wish(NamedTuple):
    """What an improved path is asked for; lengths in voxels."""

    exact: bool = True  # exact form of the penalty, else the paper's
    turn_weight: float = 0.5  # λ
    first_weight: float = 0.0  # λ_v of the first step
    first_direction: tuple[float, float, float] = (0.0, 0.0, 0.0)  # unit vector; zero: none
    rule: int = RULE_OR
    reading: int = COUNT_MADE


@dataclass(slots=True)
class VoxelGrid:
    """Free cells (X, Y, Z), surveyed once per map and searched many times."""

    free: Bool
    terrain: Terrain = field(init=False, repr=False)
    _slot: Int32 = field(init=False, repr=False)

    def __post_init__(self) -> None:
        self.terrain = survey(self.free)
        self._slot = np.empty(canonical.slots(self.terrain.shape), dtype=np.int32)
        self._slot.fill(0)  # so that no search pays for the first touch of its memory

    def shortest(self, start: Int, goal: Int, max_expansions: int = NO_LIMIT) -> VoxelPath:
        """Shortest 26-connected path that cuts no corner, exact (`canonical`).

        Args:
            start: cell (3,).
            goal: cell (3,).
            max_expansions: budget.
        """
        if not (self.free[tuple(start)] and self.free[tuple(goal)]):
            return VoxelPath(canonical.NO_PATH, np.inf, np.empty((0, 3), dtype=np.int32), 0)
        status, cost, expansions, cells = canonical.find(
            self.terrain, start + 1, goal + 1, max_expansions, self._slot
        )
        return VoxelPath(status, cost, cells - 1, expansions)

    def turning(self, start: Int, goal: Int, wish: Wish, max_expansions: int = NO_LIMIT) -> VoxelPath:
        """Path with a price on turns and a rule for vertical steps (`directed`); may miss one that exists."""
        if not (self.free[tuple(start)] and self.free[tuple(goal)]):
            return VoxelPath(canonical.NO_PATH, np.inf, np.empty((0, 3), dtype=np.int32), 0)
        terms = (wish.exact, wish.turn_weight, _first_costs(wish), wish.rule, wish.reading)
        status, cost, expansions, cells = find_directed(
            self.terrain.free, self.terrain.shape, start + 1, goal + 1, *terms, max_expansions
        )
        return VoxelPath(status, cost, cells - 1, expansions)


def _first_costs(wish: Wish) -> Float:
    """λ_v (1 - cos) of the angle between each move (27,) and the direction flown."""
    direction = np.array(wish.first_direction)
    if not direction.any():
        return np.zeros(len(STEPS))
    return np.asarray(wish.first_weight * (1.0 - STEPS @ direction / np.maximum(LENGTHS, 1.0)))

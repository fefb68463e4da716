"""Ways between the places to be visited, and the order in which a short tour visits them."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from uavexp.arrays import Float, Int, Int32
from uavexp.explorer.volume.cells import Cells
from uavexp.explorer.volume.steps import MOST_PRICE, UNIT, Prices, prices
from uavexp.explorer.volume.waves import (
    FAR,
    Wave,
    begin,
    forget,
    least_change,
    new_wave,
    reach_all,
    reach_nearest,
    straight_cost,
    trace,
)
from uavexp.inspection.tour import open_tour

_NEAREST = 6  # places to which ways are sought; those to farther ones lead through these
_LONGER, _FARTHER_M = 1.3, 1.5  # ways between places are sought up to so many straight ones and so far more
_KICKS_PER_PLACE = 1
PLACES = 12  # that a tour visits, the nearest; farther ones wait for the next
_MEMORY = 20_000  # pairs
_NARROW_PRICE = 3.0
# prices of the kinds of cells on ways over what was seen: without narrow places, with them, and with
# places of which not all around was seen, as that of the start
WIDE = prices(np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0]), np.ones(6))
NARROWER = prices(np.array([0.0, 0.0, 0.0, 1.0, 0.0, _NARROW_PRICE]), np.ones(6))
ANY = prices(np.array([0.0, 0.0, MOST_PRICE, 1.0, 0.0, _NARROW_PRICE]), np.ones(6))


def optimistic(unseen: float, climb: float) -> Prices:
    """Prices on ways that may lead over what was not seen.

    Args:
        unseen: of an unseen cell.
        climb: how much dearer steps up or down are there.
    """
    narrow = max(unseen, _NARROW_PRICE)
    return prices(
        np.array([0.0, unseen, 1.0, 1.0, narrow, _NARROW_PRICE]),
        np.array([1.0, climb, 1.0, 1.0, climb, 1.0]),
    )


def _metres(cost: Int, cell_m: float) -> Float:
    return np.where(cost < FAR, cost * (cell_m / UNIT), np.inf)


@dataclass(slots=True, kw_only=True)
class Ways:
    """Lengths of ways over the cells of a map, from the vehicle, to the target, and between places."""

    cells: Cells
    optimistic: Prices = field(repr=False)  # of ways to the target
    target: int | None = None  # cell
    _vehicle: int = -1
    _known: Prices = WIDE
    _own: Wave = field(init=False, repr=False)
    _other: Wave = field(init=False, repr=False)
    _beyond: Wave = field(init=False, repr=False)
    _number: Int32 = field(init=False, repr=False)
    _between: dict[tuple[int, int], float] = field(init=False, repr=False, default_factory=dict)
    _asked: list[tuple[int, Int, Float]] = field(init=False, repr=False, default_factory=list)

    def __post_init__(self) -> None:
        size = self.cells.kind.size
        self._own, self._other, self._beyond = new_wave(size), new_wave(size), new_wave(size)
        self._number = np.zeros(size, np.int32)
        if self.target is not None:
            begin(self._beyond, self.target)

    def note(self, changed: Int32) -> None:
        """Take note of cells (C,) that have changed their kind."""
        cells = self.cells
        if self.target is not None and len(changed):
            level = least_change(self._beyond, cells.steps, changed)
            if level < FAR - 1:
                forget(self._beyond, level)

    def begin(self, vehicle: int, known: Prices) -> None:
        """Ask for ways from this cell over what was seen, at these prices."""
        self._vehicle, self._known = vehicle, known
        begin(self._own, vehicle)

    def there_m(self, places: Int, most_m: float = np.inf) -> Float:
        """Lengths (P,) of the ways from the vehicle to cells (P,) over seen cells; inf: none so short."""
        cells = self.cells
        most = int(min(most_m / cells.cell_m * UNIT, FAR))
        cost = reach_all(self._own, cells.kind, cells.steps, self._known, places, most)
        return np.where(places == self._vehicle, 0.0, _metres(cost, cells.cell_m))

    def nearest_m(self, places: Int, group: Int, onward_m: Float, groups: int, spare_m: float) -> Float:
        """Lengths (P,) of the ways from the vehicle to the nearest places; inf to all others.

        Args:
            places: (P,) cells.
            group: (P,) that each belongs to, from 0 on.
            onward_m: (P,) what lies behind each.
            groups: so many with a place are enough.
            spare_m: places are not sought that are worse than the best by more.
        """
        cells = self.cells
        unit = UNIT / cells.cell_m
        onward = np.minimum(onward_m * unit, FAR).astype(np.int64)
        cost = reach_nearest(
            self._own, cells.kind, cells.steps, self._known, places, group, onward, self._number, groups,
            int(min(spare_m * unit, FAR)),
        )  # fmt: skip
        return np.where(places == self._vehicle, 0.0, _metres(cost, cells.cell_m))

    def way(self, cell: int) -> Int:
        """Cells (P,) of the way from the vehicle to a cell to which `there_m` has found one."""
        cells = self.cells
        found: Int = trace(self._own, cells.kind, cells.steps, self._known, cell)
        return found

    def beyond_m(self, places: Int) -> Float:
        """Lengths (P,) of the ways to the target, unseen cells being passable at their price."""
        cells = self.cells
        cost = reach_all(self._beyond, cells.kind, cells.steps, self.optimistic, places, FAR)
        return _metres(cost, cells.cell_m)

    def tour(self, places: Int, first_m: Float, there_m: Float) -> Int:
        """Order (P,) in which a short tour from the vehicle visits places.

        Args:
            places: (P,) cells.
            first_m: (P,) what it costs to begin with each.
            there_m: (P,) length of the way from the vehicle to each, finite.
        """
        kept = np.argsort(first_m, kind="stable")[:PLACES]
        between = self._matrix(places[kept], there_m[kept])
        cost = np.zeros((len(kept) + 1, len(kept) + 1))
        cost[0, 1:] = cost[1:, 0] = first_m[kept]
        cost[1:, 1:] = between
        return np.asarray(kept[open_tour(cost, kicks=_KICKS_PER_PLACE * len(kept))[1:] - 1])

    def _matrix(self, places: Int, there_m: Float) -> Float:
        """Lengths (P, P) of ways between places."""
        count, middle = len(places), self.cells.centre_m(places)
        over = there_m[:, None] + there_m  # through where the vehicle is
        straight = np.linalg.norm(middle[:, None] - middle, axis=2)
        if len(self._between) > _MEMORY:
            self._between.clear()
        self._asked = []
        for a in range(count):
            near = np.argsort(straight[a], kind="stable")[1 : _NEAREST + 1]
            missing = [int(b) for b in near if not self._knows(int(places[a]), int(places[b]))]
            if missing:  # two places may share a cell
                most_m = np.minimum(over[a, missing], _LONGER * straight[a, missing] + _FARTHER_M)
                self._asked.append((int(places[a]), places[missing], most_m))
        for a, b in np.argwhere(~np.eye(count, dtype=np.bool_)):
            known_m = self._between.get((int(places[a]), int(places[b])), np.inf)
            over[a, b] = over[b, a] = min(over[a, b], known_m)
        for via in range(count):  # Floyd and Warshall
            np.minimum(over, over[:, via, None] + over[via], out=over)
        np.fill_diagonal(over, 0.0)
        return np.asarray(np.minimum(over, over.T))

    def _knows(self, start: int, end: int) -> bool:
        """Whether the length of the way between two places is known, or is that of a straight one."""
        if (start, end) in self._between:
            return True
        cells = self.cells
        cost: int = straight_cost(cells.kind, cells.shape, self._known, start, end)
        if cost < FAR:
            self._between[start, end] = self._between[end, start] = cost * cells.cell_m / UNIT
        return cost < FAR

    def measure(self) -> None:
        """Seek the ways from one more place to others that the last tour asked for, and note their lengths.

        Not while a tour is chosen: that takes long enough.
        """
        if not self._asked:
            return
        (start, ends, most_m), cells = self._asked.pop(0), self.cells
        begin(self._other, start)
        most = int(most_m.max() / cells.cell_m * UNIT) + 1
        cost = reach_all(self._other, cells.kind, cells.steps, self._known, ends, most)
        for end, length_m in zip(ends.tolist(), _metres(cost, cells.cell_m).tolist(), strict=True):
            self._between[start, end] = self._between[end, start] = length_m

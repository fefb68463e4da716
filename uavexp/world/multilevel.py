"""A rack warehouse of several storeys: shelves on every deck, hatches and shafts between decks."""

from __future__ import annotations

from itertools import pairwise
from typing import Annotated

import numpy as np

from uavexp.arrays import Float
from uavexp.errors import require
from uavexp.parameters import FINITE, Count, Positive, Share, Whole, at_least, option
from uavexp.scene import Scene
from uavexp.world import indoor
from uavexp.world.boxes import Boxes

DECK_M = 0.06  # thickness of a deck
POST_M = 0.09  # uprights, square
SHELF_M = 0.04  # thickness of a shelf board
BAY_M = 1.8  # rack length between uprights
RAIL_M = (0.04, 1.0)  # of the rail on both long sides of a hatch: thickness, height
PASSAGE_M = 1.4  # gap in every row
RACK_HEADROOM_M = 0.35  # from a row to the ceiling of its storey
END_M = 1.0  # kept free at both ends of a storey
DUCT_M = 0.3  # side of the duct under each ceiling
TASK_ATTEMPTS = 40  # drawings of start and target in one geometry


@option
class Multilevel(indoor.Indoor):
    """Racks along x on every storey; between storeys only the hatches in the decks are open.

    Start and target lie on the lowest and the highest storey, in opposite corners, as in a
    delivery to an upper level. Every storey draws its own racks, goods and hatches.
    """

    advice = "raise hatch_m or hatches, or lower racks"

    size_m: indoor.Size = (12.78, 6.06, 8.46)  # m, inner length, width, height: paper 2's test hall
    storeys: Annotated[int, at_least(2)] = 4  # storeys of shelves, joined by hatches only [ours]
    racks: Whole = 2  # rows of racks on each storey [ours]
    rack_depth_m: Positive = 0.8  # m, depth of a rack row [ours]
    shelf_pitch_m: Annotated[float, at_least(4 * SHELF_M), FINITE] = (
        0.5  # m, height from shelf to shelf [ours]
    )
    load_share: Share = 0.6  # 0 to 1, share of shelf places that hold goods [ours]
    hatches: Count = 2  # openings in each deck [ours]
    hatch_m: Positive = 1.6  # m, length of a hatch along its aisle [ours]
    flight_height_m: Positive = 1.1  # m, of start and target above their storey's deck [ours]
    clearance_m: Positive = 0.4

    def __post_init__(self) -> None:
        indoor.Indoor.__post_init__(self)
        least = 2.0 * END_M + DUCT_M + 0.1
        require(self.size_m[0] >= least, f"size_m must be at least {least:g} m long, got {list(self.size_m)}")
        aisle = self._aisle_m()
        require(
            aisle >= 2.0 * self.clearance_m + 0.1,
            f"racks and rack_depth_m leave aisles of {aisle:.2f} m, less than twice clearance_m and 0.1 m",
        )
        headroom = self.size_m[2] / self.storeys - DECK_M - self.flight_height_m
        require(
            headroom >= self.clearance_m,
            f"flight_height_m must leave clearance_m under the next deck, {headroom:.2f} m are left",
        )
        require(
            2.0 * self.clearance_m < self.hatch_m < 0.4 * self.size_m[0],
            f"hatch_m must lie between twice clearance_m and 0.4 of the length, got {self.hatch_m}",
        )

    def _aisle_m(self) -> float:
        return (self.size_m[1] - self.racks * self.rack_depth_m) / (self.racks + 1)

    def deck_heights_m(self) -> Float:
        """Top side of each storey's floor (storeys,), the ground first."""
        return np.arange(self.storeys) * self.size_m[2] / self.storeys

    def furnish(self, boxes: Boxes, rng: np.random.Generator) -> None:
        """Decks with hatches, and the racks of every storey."""
        decks = self.deck_heights_m()
        ceilings = np.append(decks[1:] - DECK_M, self.size_m[2])
        for storey in range(self.storeys):
            if storey > 0:
                self._deck(boxes, rng, float(decks[storey]))
            self._storey(boxes, rng, float(decks[storey]), float(ceilings[storey]))

    def _deck(self, boxes: Boxes, rng: np.random.Generator, top: float) -> None:
        """One deck with hatches as wide as an aisle, railed along their sides of the racks."""
        length, width, _ = self.size_m
        aisle = self._aisle_m()
        aisles = rng.permutation(self.racks + 1)[: self.hatches]
        taken: dict[int, float] = {}
        for n in aisles:
            taken[int(n)] = float(rng.uniform(0.3, length - self.hatch_m - 0.3))
        for n in range(self.racks + 1):
            low = n * (aisle + self.rack_depth_m)
            high = min(low + aisle, width)
            begin = taken.get(n, length)
            boxes.span((0.0, low, top - DECK_M), (begin, high, top))
            boxes.span((begin + self.hatch_m, low, top - DECK_M), (length, high, top))
            if n < self.racks:  # under the racks the deck is whole
                boxes.span((0.0, high, top - DECK_M), (length, high + self.rack_depth_m, top))
            if begin < length:
                for y in (low, high - RAIL_M[0]):
                    boxes.span((begin, y, top), (begin + self.hatch_m, y + RAIL_M[0], top + RAIL_M[1]))

    def _storey(self, boxes: Boxes, rng: np.random.Generator, floor: float, ceiling: float) -> None:
        """Racks of one storey, each row with one passage, and a duct under the ceiling."""
        length, width, _ = self.size_m
        aisle = self._aisle_m()
        for n in range(self.racks):
            front = aisle + n * (self.rack_depth_m + aisle)
            begin, end = rng.uniform(1.0, 1.7), length - rng.uniform(1.0, 1.7)
            passage = begin + (end - begin - PASSAGE_M) * rng.uniform(0.1, 0.9)
            for stretch in ((begin, passage), (passage + PASSAGE_M, end)):
                self._rack(boxes, rng, stretch, front, (floor, ceiling - RACK_HEADROOM_M))
        x = float(rng.uniform(END_M, length - END_M - DUCT_M))
        boxes.span((x, 0.0, ceiling - DUCT_M), (x + DUCT_M, width, ceiling))

    def _rack(
        self,
        boxes: Boxes,
        rng: np.random.Generator,
        along: tuple[float, float],
        front: float,
        heights: tuple[float, float],
    ) -> None:
        """One stretch of rack between two x and two heights: uprights, shelves, goods."""
        (begin, end), (low, high) = along, heights
        if end - begin < 2.0 * POST_M:
            return
        back = front + self.rack_depth_m
        posts = np.linspace(begin, end - POST_M, max(2, round((end - begin) / BAY_M) + 1))
        for x in posts:
            boxes.span((x, front, low), (x + POST_M, front + POST_M, high))
            boxes.span((x, back - POST_M, low), (x + POST_M, back, high))
        shelves = np.arange(low + 0.12, high - 0.25, self.shelf_pitch_m)
        for z in shelves:
            boxes.span((begin, front, z - SHELF_M), (end, back, z))
            for left, right in pairwise(posts):
                filled, wide, deep, tall = rng.random(4)
                if filled < self.load_share:
                    x = left + POST_M
                    room = min(self.shelf_pitch_m - SHELF_M, high - z)
                    boxes.span(
                        (x, front + 0.05, z),
                        (
                            x + (right - x) * (0.5 + 0.5 * wide),
                            front + self.rack_depth_m * (0.5 + 0.45 * deep),
                            z + room * (0.4 + 0.5 * tall),
                        ),
                    )

    def ends(
        self, scene: Scene, flight_bounds: Float, rng: np.random.Generator
    ) -> tuple[Float, Float] | None:
        """Draw start and target from opposite corners, on the lowest and the highest storey."""
        flips, picks = rng.random(2) < 0.5, rng.random((2, TASK_ATTEMPTS, 2))
        ends = []
        corner = indoor.CORNER_SHARE * (flight_bounds[1, :2] - flight_bounds[0, :2])
        for end, storey in enumerate((0, self.storeys - 1)):
            height = float(self.deck_heights_m()[storey] + self.flight_height_m)
            far = flips ^ bool(end)
            base = np.where(far, flight_bounds[1, :2] - corner, flight_bounds[0, :2])
            points = np.column_stack([base + picks[end] * corner, np.full(TASK_ATTEMPTS, height)])
            clear = points[scene.distance_m(points) >= self.clearance_m + 0.05]
            if clear.shape[0] == 0:
                return None
            ends.append(clear[0])
        return ends[0], ends[1]

"""A warehouse: rows of pallet racks, aisles with cross aisles, clutter, pillars, ducts."""

from __future__ import annotations

from typing import Annotated

import numpy as np

from uavexp.errors import require
from uavexp.parameters import Positive, Share, Whole, between, option
from uavexp.world import indoor
from uavexp.world.boxes import Boxes

BAY_M = 2.7  # rack length between uprights, the common three-pallet bay
POST_M = 0.1  # uprights, square
BEAM_M = 0.08  # shelf boards and their beams, height
LOWEST_SHELF_M = 0.15
SHELF_PITCH_M = 0.6  # between shelves: carton shelving; one sees through a bay, but does not fly through
HEADROOM_M = 0.45  # between the top of the posts and the ceiling
PALLET_M = (1.2, 0.8, 0.144)  # EUR pallet
PILLAR_PITCH_M = 6.5
LITTER_TO_WALL_M = 0.75  # of an item's middle: half a pallet's diagonal
CLUTTER_GAP_M = 0.2  # least distance between two clutter items


@option
class Warehouse(indoor.Indoor):
    """Racks along x with aisles between, every row broken by cross aisles at its own places."""

    advice = "lower clutter_per_m2 or raise aisle_m"

    size_m: indoor.Size = (
        26.0,
        16.0,
        3.0,
    )  # m, inner length, width, height: missions of 25 to 30 m as in paper 1
    aisle_m: Positive = 2.2  # m, width of aisles and cross aisles [ours]
    rack_depth_m: Positive = 1.0  # m, depth of a rack row [ours]
    cross_aisles: Whole = 2  # gaps in each rack row besides its two free ends [ours]
    load_share: Share = 0.7  # 0 to 1, share of shelf places that hold goods [ours]
    clutter_per_m2: Annotated[float, between(0, 5)] = 0.14  # 1/m², pallets, cartons and stacks asked for;
    # fewer where racks stand [ours]
    pillars: bool = True  # square pillars on a 6.5 m grid [ours]
    ducts: Whole = 3  # ducts and beams that hang across the hall [ours]

    def __post_init__(self) -> None:
        indoor.Indoor.__post_init__(self)
        require(
            self.aisle_m >= 2.0 * self.clearance_m,
            f"aisle_m must be at least twice clearance_m, {2.0 * self.clearance_m:g} m, got {self.aisle_m}",
        )

    def furnish(self, boxes: Boxes, rng: np.random.Generator) -> None:
        """Racks, pillars, clutter in the aisles, and ducts under the ceiling."""
        width = self.size_m[1]
        rows = int((width - self.aisle_m) / (self.rack_depth_m + self.aisle_m))
        aisle = (width - rows * self.rack_depth_m) / (rows + 1)
        racks: list[tuple[float, float, float]] = []
        for row in range(rows):
            front = aisle + row * (self.rack_depth_m + aisle)
            for begin, end in self._stretches(rng):
                self._rack(boxes, rng, begin, end, front)
                racks.append((begin, end, front))
        if self.pillars:
            self._stand_pillars(boxes, rng)
        self._litter(boxes, rng, racks)
        self._hang_ducts(boxes, rng)

    def _stretches(self, rng: np.random.Generator) -> list[tuple[float, float]]:
        """Where along x one row has racks: between its ends, without its cross aisles."""
        length = self.size_m[0]
        ends = self.aisle_m * rng.uniform(0.9, 1.4, 2)
        begin, end = ends[0], length - ends[1]
        gaps = self.cross_aisles
        share = (np.arange(gaps) + rng.uniform(0.1, 0.9, gaps)) / max(1, gaps)
        stretches = []
        for centre in begin + share * (end - begin):
            stretches.append((begin, centre - 0.5 * self.aisle_m))
            begin = centre + 0.5 * self.aisle_m
        stretches.append((begin, end))
        return [(a, b) for a, b in stretches if b - a > 1.0]

    def _rack(self, boxes: Boxes, rng: np.random.Generator, begin: float, end: float, front: float) -> None:
        """One stretch of rack: bays of uprights and shelves, goods on the shelves."""
        back = front + self.rack_depth_m
        top = self.size_m[2] - HEADROOM_M
        bays = max(1, round((end - begin) / BAY_M))
        posts = np.linspace(begin, end - POST_M, bays + 1)
        for x in posts:
            boxes.span((x, front, 0.0), (x + POST_M, front + POST_M, top))
            boxes.span((x, back - POST_M, 0.0), (x + POST_M, back, top))
        shelves = np.arange(LOWEST_SHELF_M, top - 0.3, SHELF_PITCH_M)
        for level, z in enumerate(shelves):
            boxes.span((begin, front, z - BEAM_M), (end, back, z))
            room = SHELF_PITCH_M - BEAM_M if level + 1 < len(shelves) else top - z
            for bay in range(bays):
                self._load(boxes, rng, posts[bay] + POST_M, posts[bay + 1], front, z, room)

    def _load(
        self,
        boxes: Boxes,
        rng: np.random.Generator,
        begin: float,
        end: float,
        front: float,
        z: float,
        room: float,
    ) -> None:
        """Goods in one bay of one shelf: up to three places, each filled with `load_share`."""
        place = (end - begin) / 3.0
        for n in range(3):
            filled, wide, deep, high, at = rng.random(5)
            if filled >= self.load_share:
                continue
            size_x, size_y = place * (0.6 + 0.35 * wide), self.rack_depth_m * (0.6 + 0.38 * deep)
            x = begin + n * place + at * (place - size_x)
            y = front + 0.5 * (self.rack_depth_m - size_y)
            boxes.span((x, y, z), (x + size_x, y + size_y, z + room * (0.35 + 0.6 * high)))

    def _stand_pillars(self, boxes: Boxes, rng: np.random.Generator) -> None:
        length, width, height = self.size_m
        offset = rng.uniform(0.3, 0.7, 2) * PILLAR_PITCH_M
        for x in np.arange(offset[0], length - 0.5, PILLAR_PITCH_M):
            for y in np.arange(offset[1], width - 0.5, PILLAR_PITCH_M):
                boxes.stand(x, y, (0.35, 0.35, height))

    def _litter(
        self, boxes: Boxes, rng: np.random.Generator, racks: list[tuple[float, float, float]]
    ) -> None:
        """Things left in the aisles: empty and loaded pallets, cartons, tall stacks."""
        length, width, height = self.size_m
        taken: list[tuple[float, float, float]] = []
        for _ in range(round(self.clutter_per_m2 * length * width)):
            x, y, kind, turn, a, b, c = rng.uniform(0.0, (length, width, 1.0, 1.0, 1.0, 1.0, 1.0))
            yaw = 0.5 * np.pi * round(turn * 3.0) + 0.25 * (turn - 0.5)
            long, deep = PALLET_M[0] * (0.5 + 0.5 * a), PALLET_M[1] * (0.5 + 0.5 * b)
            x = float(np.clip(x, LITTER_TO_WALL_M, length - LITTER_TO_WALL_M))
            y = float(np.clip(y, LITTER_TO_WALL_M, width - LITTER_TO_WALL_M))
            radius = 0.5 * float(np.hypot(long, deep))
            if self._in_rack(x, y, radius, racks) or not indoor.apart(x, y, taken, radius + CLUTTER_GAP_M):
                continue
            taken.append((x, y, radius))
            if kind < 0.25:  # empty pallets, one to six on top of one another
                boxes.stand(x, y, (*PALLET_M[:2], PALLET_M[2] * (1 + int(6 * c))), yaw)
            elif kind < 0.6:  # a loaded pallet
                boxes.stand(x, y, PALLET_M, yaw)
                boxes.stand(x, y, (long, deep, 0.5 + 1.1 * c), yaw, PALLET_M[2])
            elif kind < 0.85:  # a stack of cartons, as high as a man or more
                boxes.stand(x, y, (0.5 * long, deep, min(1.4 + c, height - 0.2)), yaw)
            else:  # a post with a sign hung at head height, free below
                boxes.stand(x, y, (long, 0.12, 0.5), yaw, min(1.5 + 0.6 * c, height - 0.6))
                boxes.stand(x, y, (0.06, 0.06, height), yaw)

    def _in_rack(self, x: float, y: float, radius: float, racks: list[tuple[float, float, float]]) -> bool:
        """Whether a disc reaches into a rack (begin, end along x, front)."""
        return any(
            np.hypot(max(begin - x, 0.0, x - end), max(front - y, 0.0, y - front - self.rack_depth_m))
            < radius
            for begin, end, front in racks
        )

    def _hang_ducts(self, boxes: Boxes, rng: np.random.Generator) -> None:
        length, width, height = self.size_m
        for _ in range(self.ducts):
            across, at, size, drop = rng.random(4)
            side, low = 0.25 + 0.3 * size, height - 0.35 - 0.35 * drop
            if across < 0.6:
                boxes.span((at * (length - side), 0.0, low), (at * (length - side) + side, width, low + 0.3))
            else:
                boxes.span((0.0, at * (width - side), low), (length, at * (width - side) + side, low + 0.3))

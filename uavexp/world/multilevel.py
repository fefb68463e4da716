"""A rack warehouse of several storeys: shelves on every deck, hatches and shafts between decks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from uavexp.arrays import Float
from uavexp.errors import WorldError, require, require_positive
from uavexp.scene import Scene
from uavexp.types import World
from uavexp.world import indoor, task
from uavexp.world.boxes import WALL_M, Boxes

DECK_M = 0.06  # thickness of a deck
POST_M = 0.09  # uprights, square
SHELF_M = 0.04  # thickness of a shelf board
BAY_M = 1.8  # rack length between uprights
RAIL_M = (0.04, 1.0)  # of the rail on both long sides of a hatch: thickness, height
PASSAGE_M = 1.4  # gap in every row
RACK_HEADROOM_M = 0.35  # from a row to the ceiling of its storey
DUCT_M = 0.3  # side of the duct under each ceiling
TASK_ATTEMPTS = 40  # drawings of start and target in one geometry


@dataclass(slots=True, kw_only=True)
class Multilevel:
    """Racks along x on every storey; between storeys only the hatches in the decks are open.

    Start and target lie on the lowest and the highest storey, in opposite corners, as in a
    delivery to an upper level. Every storey draws its own racks, goods and hatches.

    Attributes:
        size_m: inner size of the hall [x, y, z], m (12.78 x 6.06 x 8.46 in Liao et al.).
        storeys: number of storeys, at least 2.
        racks: rows of racks on each storey.
        rack_depth_m: depth of a row, m.
        shelf_pitch_m: height from one shelf to the next, m.
        load_share: share of shelf places that hold goods, 0 to 1.
        hatches: openings in each deck, drawn over its aisles.
        hatch_m: length of a hatch along the aisle, m.
        flight_height_m: of start and target above their storey's deck, m.
        clearance_m: guaranteed distance of the body's centre from everything, m.
    """

    size_m: Sequence[float] = (12.78, 6.06, 8.46)
    storeys: int = 4
    racks: int = 2
    rack_depth_m: float = 0.8
    shelf_pitch_m: float = 0.5
    load_share: float = 0.6
    hatches: int = 2
    hatch_m: float = 1.6
    flight_height_m: float = 1.1
    clearance_m: float = 0.4

    def __post_init__(self) -> None:
        require(self.storeys >= 2, f"storeys must be >= 2, got {self.storeys}")
        require(self.racks >= 0, f"racks must be >= 0, got {self.racks}")
        require(self.hatches >= 1, f"hatches must be >= 1, got {self.hatches}")
        self.size_m = indoor.checked_size(self.size_m, self.flight_height_m, self.clearance_m)
        require_positive(
            rack_depth_m=self.rack_depth_m, shelf_pitch_m=self.shelf_pitch_m, hatch_m=self.hatch_m
        )
        require(0.0 <= self.load_share <= 1.0, f"load_share must be 0 to 1, got {self.load_share}")
        aisle = self._aisle_m()
        require(
            aisle >= 2.0 * self.clearance_m + 0.1,
            f"racks and rack_depth_m leave aisles of {aisle:.2f} m, less than twice clearance_m and 0.1 m",
        )
        require(
            self.shelf_pitch_m >= 4.0 * SHELF_M,
            f"shelf_pitch_m must be >= {4.0 * SHELF_M:g} m, got {self.shelf_pitch_m}",
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

    def generate(self, rng: np.random.Generator) -> World:
        """Return the world; raise `WorldError` when no drawing joins start and target."""
        size = np.array(self.size_m)
        inset = np.array([indoor.WALL_INSET_M, indoor.WALL_INSET_M, indoor.FLOOR_INSET_M])
        flight_bounds = np.stack([inset, size - inset])
        margin = WALL_M + 0.05
        for _ in range(indoor.ATTEMPTS):
            boxes = Boxes()
            boxes.shell(self.size_m)
            self._furnish(boxes, rng)
            vertices, triangles = boxes.mesh()
            scene = Scene.from_mesh(vertices, triangles)
            ends = self._ends(scene, flight_bounds, rng)
            if ends is None:
                continue
            path = task.shortest_path(scene, flight_bounds, ends[0], ends[1], self.clearance_m)
            if path.shape[0] > 0:
                return task.assemble(
                    name="multilevel",
                    scene=scene,
                    vertices_m=vertices,
                    triangles=triangles,
                    bounds_m=np.stack([np.full(3, -margin), size + margin]),
                    flight_bounds_m=flight_bounds,
                    path_m=path,
                )
        message = (
            f"multilevel: none of {indoor.ATTEMPTS} drawings joins the storeys with {self.clearance_m:g} m "
            "of clearance; raise hatch_m or hatches, or lower racks"
        )
        raise WorldError(message)

    def _furnish(self, boxes: Boxes, rng: np.random.Generator) -> None:
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
        x = float(rng.uniform(1.0, length - 1.0 - DUCT_M))
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

    def _ends(
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

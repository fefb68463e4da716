"""A floor of corridors: a maze of passages around solid blocks, with doorways and cabinets."""

from __future__ import annotations

from typing import Annotated

import numpy as np

from uavexp.arrays import Bool, Float
from uavexp.errors import require
from uavexp.parameters import Positive, Share, between, option
from uavexp.world import indoor
from uavexp.world.boxes import Boxes

DOORWAY_M = 0.2  # thickness of a doorway's frame along the passage


@option
class Corridors(indoor.Indoor):
    """Corridors on a grid of crossings: a random tree joins all, and some loops are added."""

    advice = "lower clutter_per_passage, or raise corridor_m or doorway_width_m"

    size_m: indoor.Size = (22.0, 14.0, 2.8)  # m, inner length, width, height
    corridor_m: Positive = 2.0  # m, width of a corridor [ours]
    block_m: Positive = 2.6  # m, length of the solid blocks between corridors, about [ours]
    loop_share: Share = 0.35  # 0 to 1, share of passages open beyond those that join all crossings [ours]
    doorway_share: Share = 0.25  # 0 to 1, share of open passages with a doorway [ours]
    doorway_width_m: Positive = 1.3  # m, free width of a doorway [ours]
    doorway_height_m: Positive = 2.1  # m, free height under its lintel [ours]
    clutter_per_passage: Annotated[float, between(0, 20)] = 0.6  # cabinets, boxes and hanging signs per open
    # passage, mean [ours]

    def __post_init__(self) -> None:
        indoor.Indoor.__post_init__(self)
        require(
            self.corridor_m >= 2.0 * self.clearance_m,
            f"corridor_m must be at least twice clearance_m, {2.0 * self.clearance_m:g} m, "
            f"got {self.corridor_m}",
        )
        require(
            min(self.size_m[:2]) >= 2.0 * self.corridor_m + 0.5,
            f"size_m must hold two corridors and a block, {2.0 * self.corridor_m + 0.5:g} m, "
            f"got {list(self.size_m)}",
        )

    def furnish(self, boxes: Boxes, rng: np.random.Generator) -> None:
        """Blocks between the corridors; closed passages, and open ones with doorways and clutter."""
        height = self.size_m[2]
        x, y = self._edges(self.size_m[0], rng), self._edges(self.size_m[1], rng)
        along_x, along_y = _passages(len(x) // 2, len(y) // 2, self.loop_share, rng)
        for i in range(1, len(x) - 1):  # odd rows and columns of the plan are blocks or passages
            for j in range(1, len(y) - 1):
                low, high = (x[i], y[j]), (x[i + 1], y[j + 1])
                if i % 2 == 1 and j % 2 == 1:
                    boxes.span((*low, 0.0), (*high, height))
        for i in range(len(x) - 1):
            for j in range(len(y) - 1):
                low, high = (x[i], y[j]), (x[i + 1], y[j + 1])
                if i % 2 == 1 and j % 2 == 0:
                    self._passage(boxes, rng, low, high, 0, bool(along_x[i // 2, j // 2]))
                elif i % 2 == 0 and j % 2 == 1:
                    self._passage(boxes, rng, low, high, 1, bool(along_y[i // 2, j // 2]))

    def _edges(self, length: float, rng: np.random.Generator) -> Float:
        """Where corridors and blocks begin along one side: corridor, block, ..., corridor."""
        blocks = max(1, round((length - self.corridor_m) / (self.corridor_m + self.block_m)))
        share = rng.uniform(0.75, 1.25, blocks)
        solid = share / share.sum() * (length - (blocks + 1) * self.corridor_m)
        widths = np.full(2 * blocks + 1, self.corridor_m)
        widths[1::2] = solid
        return np.concatenate([[0.0], np.cumsum(widths)])

    def _passage(
        self,
        boxes: Boxes,
        rng: np.random.Generator,
        low: tuple[float, float],
        high: tuple[float, float],
        axis: int,
        is_open: bool,
    ) -> None:
        """One passage between two crossings, running along `axis`: walled up, or furnished."""
        height = self.size_m[2]
        draws = rng.random(3)
        count = rng.poisson(self.clutter_per_passage)
        if not is_open:
            boxes.span((*low, 0.0), (*high, height))
            return
        if draws[0] < self.doorway_share:
            at = low[axis] + draws[1] * max(0.0, high[axis] - low[axis] - DOORWAY_M)
            self._doorway(boxes, low, high, axis, at)
        for _ in range(count):
            self._clutter(boxes, rng, low, high, axis)

    def _doorway(
        self, boxes: Boxes, low: tuple[float, float], high: tuple[float, float], axis: int, at: float
    ) -> None:
        side, height = 1 - axis, self.size_m[2]
        jamb = 0.5 * (high[side] - low[side] - self.doorway_width_m)
        for begin, end, base in (
            (low[side], low[side] + jamb, 0.0),
            (high[side] - jamb, high[side], 0.0),
            (low[side], high[side], self.doorway_height_m),
        ):
            corners = np.empty((2, 2))
            corners[:, axis] = at, at + DOORWAY_M
            corners[:, side] = begin, end
            boxes.span((*corners[0], base), (*corners[1], height))

    def _clutter(
        self,
        boxes: Boxes,
        rng: np.random.Generator,
        low: tuple[float, float],
        high: tuple[float, float],
        axis: int,
    ) -> None:
        """A cabinet or a box at one wall, or a sign under the ceiling."""
        side, height = 1 - axis, self.size_m[2]
        kind, wall, along, a, b, c = rng.random(6)
        long, deep = 0.4 + 0.8 * a, 0.25 + 0.35 * b
        base, tall = 0.0, 0.5 + 1.5 * c
        if kind > 0.75:
            base, tall, deep = height - 0.4 - 0.4 * c, 0.3, high[side] - low[side]
        elif kind > 0.45:
            long, deep, tall = 0.3 + 0.3 * a, 0.3 + 0.3 * b, 0.3 + 0.9 * c
        first = low[axis] + along * (high[axis] - low[axis] - long)
        corners = np.empty((2, 2))
        corners[:, axis] = first, first + long
        corners[:, side] = (low[side], low[side] + deep) if wall < 0.5 else (high[side] - deep, high[side])
        boxes.span((*corners[0], base), (*corners[1], min(height, base + tall)))


def _passages(
    crossings_x: int, crossings_y: int, loop_share: float, rng: np.random.Generator
) -> tuple[Bool, Bool]:
    """Which passages between neighbouring crossings are open: a random tree and some more.

    The counts are of blocks; there is one crossing more than blocks along each side.

    Returns:
        Along x (X, Y + 1) and along y (X + 1, Y), X and Y the numbers of blocks.
    """
    nx, ny = crossings_x + 1, crossings_y + 1
    along_x = rng.random((nx - 1, ny)) < loop_share
    along_y = rng.random((nx, ny - 1)) < loop_share
    edges = [(i, j, 0) for i in range(nx - 1) for j in range(ny)]
    edges += [(i, j, 1) for i in range(nx) for j in range(ny - 1)]
    group = np.arange(nx * ny).reshape(nx, ny)
    for n in rng.permutation(len(edges)):  # Kruskal with random weights
        i, j, axis = edges[n]
        a, b = group[i, j], group[i + 1 - axis, j + axis]
        if a != b:
            group[group == b] = a
            (along_y if axis else along_x)[i, j] = True
    return along_x, along_y

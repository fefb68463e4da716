"""Two industrial floors to inspect, after the two indoor environments of Jin et al. (paper 3, figure 3)."""

from __future__ import annotations

from enum import StrEnum

import numpy as np

from uavexp.errors import require
from uavexp.parameters import Whole, option
from uavexp.world import indoor
from uavexp.world.boxes import Boxes

WALL_M = 0.2  # thickness of inner walls
PILLAR_M = 0.5  # side of a pillar
MACHINE_M = ((0.6, 0.5, 0.8), (1.4, 1.0, 1.8))  # least and greatest size of a machine
MACHINE_KEEP_M = 1.3  # free floor beside a machine, beyond half its diagonal
TRIES = 20  # drawings of a machine's place


class Layout(StrEnum):
    """The two floors."""

    BAYS = "bays"  # a hall with bays along both long walls and a row of pillars
    RING = "ring"  # a corridor around a closed core, with two rooms beside it


@option
class Facility(indoor.Indoor):
    """A plan of straight walls, shifted a little by the seed, with machines on the floor."""

    layout: Layout = Layout.BAYS  # bays | ring, the two floors after paper 3, figure 3
    advice = "fewer machines, or a larger size_m"

    size_m: indoor.Size = (18.0, 11.0, 2.8)  # m, inner length, width, height [ours]
    machines: Whole = 4  # pieces on the floor, away from the walls [ours]

    def __post_init__(self) -> None:
        indoor.Indoor.__post_init__(self)
        require(
            min(self.size_m[:2]) >= 9.0, f"size_m must be at least 9 m long and wide, got {list(self.size_m)}"
        )

    def furnish(self, boxes: Boxes, rng: np.random.Generator) -> None:
        """The walls of the layout, and machines where there is room."""
        walls = (self._bays if self.layout is Layout.BAYS else self._ring)(rng)
        for low, high in walls:
            boxes.span((*low, 0.0), (*high, self.size_m[2]))
        self._machines(boxes, rng)

    def _bays(self, rng: np.random.Generator) -> list[tuple[tuple[float, float], tuple[float, float]]]:
        """Low and high corners of the walls between bays, and of the pillars."""
        length, width, _ = self.size_m
        count = max(2, round(length / 4.5))
        depth = 0.27 * width
        walls = []
        for n in range(1, count):
            for far in (False, True):
                x = length * n / count + rng.uniform(-0.3, 0.3)
                reach = depth + rng.uniform(-0.2, 0.2)
                low, high = (width - reach, width) if far else (0.0, reach)
                walls.append(((x - 0.5 * WALL_M, low), (x + 0.5 * WALL_M, high)))
        for n in range(1, count, 2):
            x, half = length * (n + 0.5) / count, 0.5 * PILLAR_M
            walls.append(((x - half, 0.5 * width - half), (x + half, 0.5 * width + half)))
        return walls

    def _ring(self, rng: np.random.Generator) -> list[tuple[tuple[float, float], tuple[float, float]]]:
        """Low and high corners of the core and of the wall, with two doors, before the two rooms."""
        length, width, _ = self.size_m
        core = 0.16 * length + rng.uniform(-0.2, 0.2), 0.42 * length + rng.uniform(-0.2, 0.2)
        walls = [((core[0], 0.3 * width), (core[1], 0.7 * width))]
        x, middle, door = 0.62 * length + rng.uniform(-0.2, 0.2), 0.5 * width, 1.4
        at = [rng.uniform(1.0, middle - 1.0 - door), middle + rng.uniform(1.0, middle - 1.0 - door)]
        ends = [0.0, at[0], at[0] + door, at[1], at[1] + door, width]
        for low, high in zip(ends[::2], ends[1::2], strict=True):
            walls.append(((x, low), (x + WALL_M, high)))
        walls.append(((x + WALL_M, middle - 0.5 * WALL_M), (length, middle + 0.5 * WALL_M)))
        return walls

    def _machines(self, boxes: Boxes, rng: np.random.Generator) -> None:
        """Machines apart from the walls and from each other, so that every side can be seen."""
        blocked = [(row[0], row[1], row[3], row[4]) for row in boxes.rows if 0.0 < row[2] < self.size_m[2]]
        for _ in range(self.machines):
            size = rng.uniform(*MACHINE_M)
            keep = 0.5 * float(np.hypot(size[0], size[1])) + MACHINE_KEEP_M
            for _ in range(TRIES):
                x, y = rng.uniform(0.0, 1.0, 2) * self.size_m[:2]
                far = (max(abs(x - cx) - 0.5 * sx, abs(y - cy) - 0.5 * sy) for cx, cy, sx, sy in blocked)
                if all(gap > keep for gap in far):
                    boxes.stand(x, y, tuple(size), rng.uniform(0.0, np.pi))
                    blocked.append((x, y, size[0], size[1]))
                    break

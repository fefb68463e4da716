"""A hall of random columns: standing, hanging, and stumps."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from uavexp.errors import require, require_non_negative
from uavexp.types import World
from uavexp.world import indoor
from uavexp.world.boxes import Boxes


@dataclass(slots=True, kw_only=True)
class RandomColumns:
    """Round and square columns at random places, at least `gap_m` from one another.

    Attributes:
        size_m: inner size of the hall [x, y, z], m.
        density_per_m2: columns asked for per m² of floor, 1/m²; fewer where no room is left.
        width_m: least and greatest width [min, max], m.
        gap_m: least free distance between two columns of different rows, about, m.
        row: greatest number of columns that stand side by side in one row, each row 1 to `row` long.
        partial_share: share that reaches only from the ceiling down or the floor up, 0 to 1.
        flight_height_m: z of start and target, m.
        clearance_m: guaranteed distance of the body's centre from everything, m.
    """

    size_m: Sequence[float] = (26.0, 16.0, 3.0)
    density_per_m2: float = 0.3
    width_m: Sequence[float] = (0.3, 1.2)
    gap_m: float = 1.0
    row: int = 4
    partial_share: float = 0.3
    flight_height_m: float = 1.2
    clearance_m: float = 0.45

    def __post_init__(self) -> None:
        self.size_m = indoor.checked_size(self.size_m, self.flight_height_m, self.clearance_m)
        require_non_negative(density_per_m2=self.density_per_m2, gap_m=self.gap_m)
        require(self.density_per_m2 <= 5.0, f"density_per_m2 must be <= 5, got {self.density_per_m2}")
        self.width_m = indoor.checked_range("width_m", self.width_m)
        require(1 <= self.row <= 50, f"row must be 1 to 50 columns, got {self.row}")
        require(0.0 <= self.partial_share <= 1.0, f"partial_share must be 0 to 1, got {self.partial_share}")

    def generate(self, rng: np.random.Generator) -> World:
        """Return the world; raise `WorldError` when no drawing joins start and target."""
        return indoor.draw(
            name="random_columns",
            furnish=self._furnish,
            size_m=tuple(self.size_m),
            flight_height_m=self.flight_height_m,
            clearance_m=self.clearance_m,
            advice="lower density_per_m2 or clearance_m, or raise gap_m",
            rng=rng,
        )

    def _furnish(self, boxes: Boxes, rng: np.random.Generator) -> None:
        length, width, _ = self.size_m
        taken: list[tuple[float, float, float]] = []
        missing = round(self.density_per_m2 * length * width)
        while missing > 0:
            x, y, turn = rng.uniform(0.0, (length, width, np.pi))
            members: list[tuple[float, float, float]] = []
            for _ in range(int(rng.integers(1, self.row + 1))):
                across = rng.uniform(self.width_m[0], self.width_m[1])
                reach = 0.5 * np.sqrt(2.0) * across  # of a square column's corner
                x = float(np.clip(x, reach, length - reach))
                y = float(np.clip(y, reach, width - reach))
                if indoor.apart(x, y, taken, 0.5 * across + self.gap_m):
                    members.append((x, y, 0.5 * across))
                    self._column(boxes, rng, x, y, across)
                x, y = x + across * np.cos(turn), y + across * np.sin(turn)
                missing -= 1
            taken.extend(members)

    def _column(self, boxes: Boxes, rng: np.random.Generator, x: float, y: float, across: float) -> None:
        """One column, round or square, whole or in part."""
        height = self.size_m[2]
        square, turn, kind, cut = rng.random(4)
        low, high = 0.0, height
        if kind < 0.5 * self.partial_share:
            low = (0.45 + 0.35 * cut) * height  # hangs from the ceiling
        elif kind < self.partial_share:
            high = (0.15 + 0.35 * cut) * height  # a stump
        if square < 0.4:
            boxes.stand(x, y, (across, across, high - low), 0.5 * np.pi * turn, low)
        else:
            boxes.column(x, y, across, low, high)

"""A hall of random columns: standing, hanging, and stumps."""

from __future__ import annotations

from typing import Annotated

import numpy as np

from uavexp.parameters import NonNegative, Range, Share, between, option
from uavexp.world import indoor
from uavexp.world.boxes import Boxes


@option
class RandomColumns(indoor.Indoor):
    """Round and square columns at random places, at least `gap_m` from one another."""

    advice = "lower density_per_m2 or clearance_m, or raise gap_m"

    size_m: indoor.Size = (26.0, 16.0, 3.0)  # m, inner length, width, height of the hall
    density_per_m2: Annotated[float, between(0, 5)] = 0.3  # 1/m², columns asked for per floor area;
    # fewer where no room is left [ours]
    width_m: Range = (0.3, 1.2)  # m, least and greatest column width [ours]
    gap_m: NonNegative = 1.0  # m, least free distance between two columns of different rows, about [ours]
    row: Annotated[int, between(1, 50)] = 4  # greatest number of columns side by side in one row [ours]
    partial_share: Share = 0.3  # 0 to 1, share that hangs from the ceiling or is a stump [ours]

    def furnish(self, boxes: Boxes, rng: np.random.Generator) -> None:
        """Stand or hang columns, alone and in rows."""
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

"""A bent tunnel with a stepped vault, after the flight test of Jin et al. (paper 3, figure 4)."""

from __future__ import annotations

import numpy as np

from uavexp.errors import require
from uavexp.parameters import NonNegative, Positive, option
from uavexp.world import indoor
from uavexp.world.boxes import Boxes

SLICE_M = 1.0  # length of the slices that the rock is made of
VAULT = ((0.25, 0.5), (0.5, 0.25))  # steps of the vault: width at each side and height from the crown, m


@option
class Tunnel(indoor.Indoor):
    """Rock left and right of a passage that goes from one corner of the map to the opposite one."""

    advice = "lower roughness_m, or raise width_m"

    size_m: indoor.Size = (24.0, 9.0, 3.2)  # m, inner length, width, height of the box that holds it [ours]
    width_m: Positive = 3.6  # m, of the passage [ours]
    roughness_m: NonNegative = 0.1  # m, by which each metre of a wall stands forward or back at most [ours]

    def __post_init__(self) -> None:
        indoor.Indoor.__post_init__(self)
        least = 2.0 * (self.clearance_m + self.roughness_m) + 1.5
        require(
            least <= self.width_m <= self.size_m[1] - 0.5,
            f"width_m must be {least:g} m to {self.size_m[1] - 0.5:g} m, got {self.width_m}",
        )

    def furnish(self, boxes: Boxes, rng: np.random.Generator) -> None:
        """Rock on both sides of the passage, slice by slice."""
        length, across, height = self.size_m
        slices = int(np.ceil(length / SLICE_M))
        edges = np.linspace(0.0, length, slices + 1)
        share = (edges[:-1] + edges[1:]) / (2.0 * length)
        bend = share * share * (3.0 - 2.0 * share)  # from 0 to 1, level at both ends
        middle = 0.5 * self.width_m + bend * (across - self.width_m)
        if rng.random() < 0.5:
            middle = across - middle
        half = 0.5 * self.width_m + rng.uniform(-self.roughness_m, self.roughness_m, (2, slices))
        for n in range(slices):
            low, high = middle[n] - half[0, n], middle[n] + half[1, n]
            span = edges[n], edges[n + 1]
            boxes.span((span[0], 0.0, 0.0), (span[1], low, height))
            boxes.span((span[0], high, 0.0), (span[1], across, height))
            for wide, deep in VAULT:
                boxes.span((span[0], low, height - deep), (span[1], low + wide, height))
                boxes.span((span[0], high - wide, height - deep), (span[1], high, height))

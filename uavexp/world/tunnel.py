"""A bent tunnel with a stepped vault, after the flight test of Jin et al. (paper 3, figure 4)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from uavexp.errors import require, require_non_negative, require_positive
from uavexp.types import World
from uavexp.world import indoor
from uavexp.world.boxes import Boxes

SLICE_M = 1.0  # length of the slices that the rock is made of
VAULT = ((0.25, 0.5), (0.5, 0.25))  # steps of the vault: width at each side and height from the crown, m


@dataclass(slots=True, kw_only=True)
class Tunnel:
    """Rock left and right of a passage that goes from one corner of the map to the opposite one.

    Attributes:
        size_m: inner size of the box that holds it [x, y, z], m; x is the way through.
        width_m: of the passage, m.
        roughness_m: by how much each slice of a wall stands forward or back at most, m.
        flight_height_m: z of start and target, m.
        clearance_m: guaranteed distance of the body's centre from everything, m.
    """

    size_m: Sequence[float] = (24.0, 9.0, 3.2)
    width_m: float = 3.6
    roughness_m: float = 0.1
    flight_height_m: float = 1.2
    clearance_m: float = 0.45

    def __post_init__(self) -> None:
        self.size_m = indoor.checked_size(self.size_m, self.flight_height_m, self.clearance_m)
        require_positive(width_m=self.width_m)
        require_non_negative(roughness_m=self.roughness_m)
        least = 2.0 * (self.clearance_m + self.roughness_m) + 1.5
        require(
            least <= self.width_m <= self.size_m[1] - 0.5,
            f"width_m must be {least:g} m to {self.size_m[1] - 0.5:g} m, got {self.width_m}",
        )

    def generate(self, rng: np.random.Generator) -> World:
        """Return the world; raise `WorldError` when no drawing joins start and target."""
        return indoor.draw(
            name="tunnel",
            furnish=self._furnish,
            size_m=tuple(self.size_m),
            flight_height_m=self.flight_height_m,
            clearance_m=self.clearance_m,
            advice="lower roughness_m, or raise width_m",
            rng=rng,
        )

    def _furnish(self, boxes: Boxes, rng: np.random.Generator) -> None:
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

"""Geometry built from boxes, written as one triangle mesh of 12 triangles a box."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from uavexp.arrays import Float, Float32, Int32

WALL_M = 0.15  # thickness of floor, ceiling and outer walls, outside the inner box
_CORNERS = np.array([[i, j, k] for i in (-0.5, 0.5) for j in (-0.5, 0.5) for k in (-0.5, 0.5)])
_FACES = np.array(
    [
        [0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5],  # -x, +x
        [0, 4, 5], [0, 5, 1], [2, 3, 7], [2, 7, 6],  # -y, +y
        [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3],  # -z, +z
    ]
)  # fmt: skip


@dataclass(slots=True)
class Boxes:
    """A growing list of boxes, each turned about z by its own angle."""

    rows: list[tuple[float, ...]] = field(default_factory=list)  # centre, size, yaw_rad

    def span(self, low_m: Sequence[float], high_m: Sequence[float]) -> None:
        """Add the box between two corners; nothing when it is empty along an axis."""
        size = [high - low for low, high in zip(low_m, high_m, strict=True)]
        if min(size) > 0.0:
            centre = [0.5 * (low + high) for low, high in zip(low_m, high_m, strict=True)]
            self.rows.append((*centre, *size, 0.0))

    def stand(
        self, x_m: float, y_m: float, size_m: Sequence[float], yaw_rad: float = 0.0, base_m: float = 0.0
    ) -> None:
        """Add a box of `size_m` around (x, y), its underside at `base_m`."""
        self.rows.append((x_m, y_m, base_m + 0.5 * size_m[2], *size_m, yaw_rad))

    def place(self, x_m: float, y_m: float, yaw_rad: float, parts: Sequence[Sequence[float]]) -> None:
        """Add a piece of furniture: parts (x, y, z, sx, sy, sz) about its own origin, z the underside."""
        c, s = math.cos(yaw_rad), math.sin(yaw_rad)
        for x, y, z, *size in parts:
            self.stand(x_m + c * x - s * y, y_m + s * x + c * y, size, yaw_rad, z)

    def column(self, x_m: float, y_m: float, width_m: float, low_m: float, high_m: float) -> None:
        """Add an eight-sided column, `width_m` across its flats: the union of four boxes."""
        side = width_m * math.tan(math.pi / 8.0)
        for turn in range(4):
            self.stand(x_m, y_m, (width_m, side, high_m - low_m), turn * math.pi / 4.0, low_m)

    def shell(self, size_m: Sequence[float]) -> None:
        """Add floor, ceiling and the four outer walls around the inner box [0, size]."""
        x, y, z = size_m
        w = WALL_M
        self.span((-w, -w, -w), (x + w, y + w, 0.0))
        self.span((-w, -w, z), (x + w, y + w, z + w))
        self.span((-w, -w, 0.0), (0.0, y + w, z))
        self.span((x, -w, 0.0), (x + w, y + w, z))
        self.span((0.0, -w, 0.0), (x, 0.0, z))
        self.span((0.0, y, 0.0), (x, y + w, z))

    def mesh(self) -> tuple[Float32, Int32]:
        """Return vertices (8 B, 3), m, and triangles (12 B, 3), normals outward."""
        rows: Float = np.array(self.rows)
        local = _CORNERS[None] * rows[:, None, 3:6]
        c, s = np.cos(rows[:, 6])[:, None], np.sin(rows[:, 6])[:, None]
        corners = np.stack(
            [c * local[..., 0] - s * local[..., 1], s * local[..., 0] + c * local[..., 1], local[..., 2]], -1
        )
        corners += rows[:, None, :3]
        triangles = _FACES[None] + 8 * np.arange(rows.shape[0])[:, None, None]
        return corners.reshape(-1, 3).astype(np.float32), triangles.reshape(-1, 3).astype(np.int32)

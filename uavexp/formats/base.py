"""What a building's file holds, in its own frame and unit, whatever its format."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from uavexp.arrays import Float, Int32, UInt8

UNMEASURED, FREE, SOLID = 0, 1, 2  # states of a cell


def _none() -> Float:
    return np.empty((0, 3))


@dataclass(frozen=True, slots=True, kw_only=True)
class Cells:
    """Space measured cell by cell; cell (i, j, k) begins at origin + turned by yaw (i, j, k) * size."""

    state: UInt8  # (X, Y, Z), UNMEASURED, FREE or SOLID
    origin: Float  # (3,) lower corner of cell (0, 0, 0)
    size: Float  # (3,) of a cell along each axis
    yaw_rad: float = 0.0  # about z, through the origin
    is_plan: bool = False  # one layer, from floor to ceiling


@dataclass(frozen=True, slots=True, kw_only=True)
class Content:
    """A surface, points or cells: the one that the file holds; the others are empty."""

    kind: str  # for people, e.g. "ply mesh"
    vertices: Float = field(default_factory=_none)  # (V, 3)
    triangles: Int32 = field(default_factory=lambda: np.empty((0, 3), dtype=np.int32))  # (F, 3)
    points: Float = field(default_factory=_none)  # (N, 3)
    cells: Cells | None = None
    warnings: tuple[str, ...] = ()  # what a person should know of it, a sentence each


@dataclass(frozen=True, slots=True, kw_only=True)
class Options:
    """What a file may leave open."""

    wall_height_m: float = 2.5  # to which a plan is extruded from z = 0
    layers: tuple[str, ...] = ()  # of a drawing that are walls; none: all of them

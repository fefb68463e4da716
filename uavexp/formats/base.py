"""What a building's file holds, in its own frame and unit, whatever its format."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from uavexp.arrays import Float, Int, Int32, UInt8
from uavexp.errors import WorldError
from uavexp.space import FREE as FREE  # states of a cell
from uavexp.space import SOLID as SOLID
from uavexp.space import UNMEASURED as UNMEASURED


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
    unit_m: float | None = None  # length of one unit, where the file or its format tells
    up_axis: str | None = None  # x, y or z, likewise
    warnings: tuple[str, ...] = ()  # what a person should know of it, a sentence each


@dataclass(frozen=True, slots=True, kw_only=True)
class Options:
    """What a file may leave open."""

    wall_height_m: float = 2.5  # to which a plan is extruded from z = 0
    unit_m: float | None = None  # length of one unit of the file; None: as the file tells, or 1
    layers: tuple[str, ...] = ()  # of a drawing that are walls; none: all of them


def mesh(path: Path, kind: str, vertices: Float, triangles: Int, warnings: tuple[str, ...] = ()) -> Content:
    """Return the content of a mesh file.

    Args:
        path: named in the errors.
        kind: see `Content`.
        vertices: (V, 3).
        triangles: (F, 3), indices of vertices.
        warnings: see `Content`.

    Raises:
        WorldError: no triangle, a vertex that is not finite, an index that names no vertex.
    """
    if triangles.shape[0] == 0:
        raise WorldError(f"world file {path} holds no triangles")
    finite = np.isfinite(vertices).all(axis=1)
    if not finite.all():
        bad = int(np.count_nonzero(~finite))
        raise WorldError(f"world file {path} has {bad} vertices that are NaN or infinite")
    low, high = int(triangles.min()), int(triangles.max())
    if low < 0 or high >= vertices.shape[0]:
        wrong = low if low < 0 else high
        raise WorldError(
            f"world file {path} is damaged: a triangle names vertex {wrong} of {vertices.shape[0]}"
        )
    return Content(
        kind=kind, vertices=vertices, triangles=triangles.astype(np.int32, copy=False), warnings=warnings
    )


def cloud(path: Path, kind: str, points: Float, warnings: tuple[str, ...] = ()) -> Content:
    """Return the content of a file of points (N, 3), those that are not finite dropped with a warning.

    Raises:
        WorldError: no point is finite.
    """
    finite = np.isfinite(points).all(axis=1)
    if not finite.any():
        raise WorldError(f"world file {path} holds no valid points")
    dropped = int(np.count_nonzero(~finite))
    if dropped:
        points = points[finite]
        warnings = (*warnings, f"{dropped} of {finite.size} points are NaN or infinite and were dropped")
    return Content(kind=kind, points=points, warnings=warnings)

"""Meshes placed in one frame, of files that hold a scene."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from uavexp.arrays import Float, Int
from uavexp.errors import WorldError
from uavexp.formats.base import Content, mesh

MAX_SIZE = 100_000_000  # vertices and triangles; a small file can place one mesh any number of times


class Parts:
    """The meshes of a scene so far."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._size = 0  # triangles and vertices
        self._vertices: list[Float] = [np.empty((0, 3))]
        self._triangles: list[Int] = [np.empty((0, 3), dtype=np.int64)]
        self._first = 0

    def add(self, vertices: Float, triangles: Int, matrix: Float) -> None:
        """Place a mesh.

        Args:
            vertices: (V, 3).
            triangles: (F, 3), which stay turned outward where the matrix mirrors.
            matrix: (4, 4), from the mesh's frame to the scene's.

        Raises:
            WorldError: the scene has become too large.
        """
        self._size += triangles.shape[0] + vertices.shape[0]
        if self._size > MAX_SIZE:
            raise WorldError(
                f"world file {self.path} places more than {MAX_SIZE} vertices and triangles; give less"
            )
        if np.linalg.det(matrix[:3, :3]) < 0.0:
            triangles = triangles[:, ::-1]
        self._vertices.append(vertices @ matrix[:3, :3].T + matrix[:3, 3])
        self._triangles.append(triangles + self._first)
        self._first += vertices.shape[0]

    @property
    def vertices(self) -> Float:
        """All vertices (V, 3) in the scene's frame."""
        return np.concatenate(self._vertices)

    def content(
        self, kind: str, warnings: tuple[str, ...], *, unit_m: float | None = None, up_axis: str | None = None
    ) -> Content:
        """Return all of them as one mesh; see `Content`."""
        content = mesh(self.path, kind, self.vertices, np.concatenate(self._triangles), warnings)
        return replace(content, unit_m=unit_m, up_axis=up_axis)

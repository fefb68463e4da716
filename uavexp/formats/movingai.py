"""Voxel maps of the Moving AI benchmark (`.3dmap`; Brewer and Sturtevant 2018)."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from uavexp.errors import WorldError
from uavexp.formats import grid
from uavexp.formats.base import Content, Options
from uavexp.formats.text import rows

_LONGEST = 200  # bytes of the first line


def read(path: Path, options: Options) -> Content:
    """Return the cells: a line `voxel X Y Z` gives their numbers, each further one a blocked cell."""
    with path.open("rb") as file:
        words = file.readline(_LONGEST).split()
        if len(words) != 4 or words[0] != b"voxel" or not all(w.isdigit() and len(w) < 10 for w in words[1:]):
            raise WorldError(f"world file {path} is no 3dmap file: it does not begin with 'voxel X Y Z'")
        blocked = rows(path, file, (0, 1, 2))
    return Content(
        kind="3dmap voxels", cells=grid.of_blocked(path, np.array(words[1:], dtype=float), blocked)
    )

"""The map as a closed mesh of its occupied voxels' faces (binary PLY)."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from uavexp.export.map_voxels import map_voxels
from uavexp.store.stored_trial import StoredTrial
from uavexp.world.voxel_mesh import exposed_faces

_HEADER = """ply
format binary_little_endian 1.0
comment map of {name}, m, z up
element vertex {vertices}
property float x
property float y
property float z
element face {faces}
property list uchar int vertex_indices
end_header
"""


def write(trial: StoredTrial, file: Path) -> Sequence[Path]:
    """Write the mesh, normals outward."""
    voxels = map_voxels(trial.log)
    vertices, triangles = exposed_faces(voxels.occupied, voxels.origin_m, np.full(3, voxels.voxel_size_m))
    faces = np.empty(len(triangles), dtype=[("count", "u1"), ("vertex", "<i4", 3)])
    faces["count"], faces["vertex"] = 3, triangles
    header = _HEADER.format(name=trial.name, vertices=len(vertices), faces=len(triangles))
    file.write_bytes(header.encode() + vertices.astype("<f4").tobytes() + faces.tobytes())
    return [file]

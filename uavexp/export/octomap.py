"""The map as OctoMap's binary octree, `.bt` (Hornung et al. 2013; OctoMap 1.10, `OccupancyOcTreeBase`).

A node is 16 bits, two for each child: 0 unknown, 1 free, 2 occupied, 3 a node that follows, depth first.
Eight equal leaves are one. Voxels are those of a grid through 0; a map whose origin is no multiple of its
voxels is shifted by less than half a voxel.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt

from uavexp.arrays import UInt8
from uavexp.errors import ConfigError
from uavexp.export.map_voxels import map_voxels
from uavexp.store.stored_trial import StoredTrial

DEPTH = 16
FREE, OCCUPIED, INNER = 1, 2, 3
_ALL = {FREE: 0x5555, OCCUPIED: 0xAAAA}  # all eight children alike
_HEADER = (
    "# Octomap OcTree binary file\n# map of {name}, m\nid OcTree\nsize {nodes}\nres {size_m:.6g}\ndata\n"
)

Codes = npt.NDArray[np.uint64]


def write(trial: StoredTrial, file: Path) -> Sequence[Path]:
    """Write the octree.

    Raises:
        ConfigError: nothing was mapped, or the map is wider than an octree of 16 levels.
    """
    voxels = map_voxels(trial.log)
    index = np.argwhere(voxels.occupied | voxels.free)
    kinds = np.where(voxels.occupied[tuple(index.T)], OCCUPIED, FREE).astype(np.uint8)
    keys = index + np.rint(voxels.origin_m / voxels.voxel_size_m).astype(np.int64) + (1 << (DEPTH - 1))
    if not len(keys) or keys.min() < 0 or keys.max() >= 1 << DEPTH:
        raise ConfigError(f"{trial.name}: an octomap needs 1 to 65,536 voxels along each axis around 0")
    nodes, data = tree_bytes(morton_codes(keys.astype(np.uint64)), kinds)
    header = _HEADER.format(name=trial.name, nodes=nodes, size_m=voxels.voxel_size_m)
    file.write_bytes(header.encode() + data)
    return [file]


def morton_codes(keys: Codes) -> Codes:
    """Interleaved bits (N,) of keys (N, 3); x is the lowest of each three."""
    codes = np.zeros(len(keys), dtype=np.uint64)
    for bit in range(DEPTH):
        for axis in range(3):
            codes |= (keys[:, axis] >> np.uint64(bit) & np.uint64(1)) << np.uint64(3 * bit + axis)
    return codes


def tree_bytes(codes: Codes, kinds: UInt8) -> tuple[int, bytes]:
    """Nodes of the tree, leaves included, and its bytes.

    Args:
        codes: of the leaves (N,), each once.
        kinds: FREE or OCCUPIED of each.
    """
    order = np.argsort(codes)
    codes, kinds = codes[order], kinds[order]
    total, places, depths, words = 1, [], [], []
    for depth in range(DEPTH - 1, -1, -1):
        first = np.flatnonzero(np.diff(codes >> np.uint64(3), prepend=np.uint64(1) << np.uint64(63)))
        shifted = kinds.astype(np.uint16) << (2 * (codes & np.uint64(7))).astype(np.uint16)
        children = np.bitwise_or.reduceat(shifted, first)
        count = np.diff(first, append=len(codes))
        codes = codes[first] >> np.uint64(3)
        kinds = np.full(len(codes), INNER, dtype=np.uint8)
        for kind, alike in _ALL.items():
            kinds[(children == alike) & (depth > 0)] = kind
        inner = kinds == INNER
        total += int(count[inner].sum())
        # a node comes before all that lies below it: by the first leaf it could have, then by depth
        places.append(codes[inner] << np.uint64(3 * (DEPTH - depth)))
        depths.append(np.full(int(inner.sum()), depth))
        words.append(children[inner])
    sequence = np.lexsort((np.concatenate(depths), np.concatenate(places)))
    return total, np.concatenate(words)[sequence].astype("<u2").tobytes()

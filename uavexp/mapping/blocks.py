"""The blocks of Open3D's voxel block grid as arrays, and which of them hold given voxels."""

from __future__ import annotations

from typing import Any

import numba as nb
import numpy as np

from uavexp.arrays import Float32, Int32
from uavexp.mapping.occupancy import Voxels
from uavexp.o3d import open3d

EDGE = 8  # voxels along a block
_BLOCK = EDGE**3


@nb.njit(cache=True)
def blocks_of(touched: Int32, shape: tuple[int, int, int]) -> tuple[Int32, Int32]:
    """Blocks (B, 3) that hold voxels (N,), and for each voxel which of them and where in it (N, 2)."""
    counts = [(size + EDGE - 1) // EDGE for size in shape]
    number = np.full(counts[0] * counts[1] * counts[2], -1, np.int32)
    blocks, local, count = (
        np.empty((touched.shape[0], 3), np.int32),
        np.empty((touched.shape[0], 2), np.int32),
        0,
    )
    for n in range(touched.shape[0]):
        x, rest = divmod(np.int64(touched[n]), shape[1] * shape[2])
        y, z = divmod(rest, shape[2])
        i, j, k = x // EDGE, y // EDGE, z // EDGE
        block = (i * counts[1] + j) * counts[2] + k
        if number[block] < 0:
            number[block] = count
            blocks[count, 0], blocks[count, 1], blocks[count, 2] = i, j, k
            count += 1
        local[n, 0] = number[block]
        local[n, 1] = (x - i * EDGE) + EDGE * ((y - j * EDGE) + EDGE * (z - k * EDGE))
    return blocks[:count], local


@nb.njit(cache=True)
def write_voxels(
    touched: Int32, local: Int32, rows: Int32, voxels: Voxels, truncation_m: float,
    fused: Float32, weights: Float32,
) -> None:  # fmt: skip
    """Write fused voxels into Open3D's blocks; `local` of `blocks_of`, `rows` of `Blocks`."""
    for n in range(touched.shape[0]):
        row = rows[local[n, 0]]
        fused[row, local[n, 1]] = voxels.tsdf_m[touched[n]] / truncation_m
        weights[row, local[n, 1]] = voxels.weight[touched[n]]


class Blocks:
    """The values of some blocks as arrays to read and write: in place on the CPU, copied for a GPU."""

    def __init__(self, grid: Any, blocks: Int32, device: Any) -> None:
        self._device = device
        self._attributes = [grid.attribute(name) for name in ("tsdf", "weight")]
        self._rows, _ = grid.hashmap().find(open3d.core.Tensor(blocks, device=device))
        self._copies: list[Float32] = []

    def __enter__(self) -> tuple[Int32, Float32, Float32]:
        rows = self._rows.cpu().numpy().astype(np.int32)
        if self._device.get_type() == open3d.core.Device.DeviceType.CPU:
            fused, weights = (tensor.numpy().reshape(-1, _BLOCK) for tensor in self._attributes)
            return rows, fused, weights
        index = self._rows.to(open3d.core.int64)
        self._copies = [tensor[index].cpu().numpy().copy() for tensor in self._attributes]
        fused, weights = (copy.reshape(-1, _BLOCK) for copy in self._copies)
        return np.arange(rows.shape[0], dtype=np.int32), fused, weights

    def __exit__(self, *_: object) -> None:
        index = self._rows.to(open3d.core.int64)
        for tensor, copy in zip(self._attributes, self._copies, strict=False):
            tensor[index] = open3d.core.Tensor(copy, device=self._device)

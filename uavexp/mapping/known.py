"""Map backend `known`: the true fixed geometry, known from the start; for studies of planning alone.

It is the map that a perfect sensor would have made in the end, with the same rule: a voxel is
occupied when the signed distance of its centre to the true surfaces is below
`occupied_below_m`, negative inside of solids. Meshes need not be closed, so what is inside is
told by air instead: steps from the start bubble (`mark_free`), from voxel centre to
neighbouring centre, that cross no surface. What no such steps reach is solid: the insides of
things, and what lies behind closed walls. A sheet with air on both sides has no inside: of two
reached neighbours with a surface between them, the nearer one is occupied (both, at equal
distance). Movers are not in it.
"""

from __future__ import annotations

import dataclasses
import math

import numba as nb
import numpy as np

from uavexp.arrays import Bool, Float, Float32, Int, Int32, UInt8
from uavexp.errors import require
from uavexp.field import FREE, OCCUPIED, DistanceField
from uavexp.mapping.esdf import SignedDistance
from uavexp.mapping.map_parameters import FieldParameters
from uavexp.mapping.occupancy import ball, grid_shape
from uavexp.mapping.tiles import count_changes, no_changes
from uavexp.parameters import NonNegative, option
from uavexp.scan import Scan
from uavexp.scene import Scene
from uavexp.types import MapUpdate

_BYTES_PER_VOXEL = 80  # ESDF 19, centres, rays and distances while it is made
_BLOCKS = (8, 4, 2)  # edges of the blocks of voxels asked first, each half the one before
_SAME_M = 1e-4  # distances nearer than this are equal: the scene's are float32


@nb.njit(cache=True)
def _air(crossed: UInt8, begin: tuple[int, int, int]) -> UInt8:
    """Which voxels (X, Y, Z) are reached from one of them; bit a of `crossed`: no step up along axis a."""
    nx, ny, nz = crossed.shape
    reached = np.zeros(crossed.shape, np.uint8)
    stack, count = np.empty((crossed.size, 3), np.int32), 1
    stack[0, 0], stack[0, 1], stack[0, 2] = begin
    reached[begin] = 1
    while count > 0:
        count -= 1
        x, y, z = stack[count, 0], stack[count, 1], stack[count, 2]
        for axis in range(3):
            for way in (-1, 1):
                i, j, k = x + way * (axis == 0), y + way * (axis == 1), z + way * (axis == 2)
                if i < 0 or j < 0 or k < 0 or i >= nx or j >= ny or k >= nz or reached[i, j, k]:
                    continue
                lower = crossed[x, y, z] if way > 0 else crossed[i, j, k]
                if (lower >> axis) & 1:
                    continue
                reached[i, j, k] = 1
                stack[count, 0], stack[count, 1], stack[count, 2] = i, j, k
                count += 1
    return reached


@nb.njit(cache=True)
def _sheets(crossed: UInt8, reached: UInt8, distance: Float32, same: float, state: UInt8) -> None:
    """Occupy the nearer one of two reached neighbours with a surface between them."""
    for x in range(crossed.shape[0]):
        for y in range(crossed.shape[1]):
            for z in range(crossed.shape[2]):
                for axis in range(3):
                    if not (crossed[x, y, z] >> axis) & 1:
                        continue
                    i, j, k = x + (axis == 0), y + (axis == 1), z + (axis == 2)
                    if not (reached[x, y, z] and reached[i, j, k]):
                        continue
                    here, there = distance[x, y, z], distance[i, j, k]
                    if here <= there + same:
                        state[x, y, z] = OCCUPIED
                    if there <= here + same:
                        state[i, j, k] = OCCUPIED


def _near_surfaces(
    scene: Scene, origin_m: Float, voxel_m: float, shape: tuple[int, ...], reach_m: float
) -> Int:
    """Flat indices of all voxels whose centre may be within `reach_m` of a surface, and of few others.

    Blocks of voxels are asked first, at their centre: most of the distances lie far from any surface.
    """
    near = np.ones([math.ceil(n / _BLOCKS[0]) for n in shape], dtype=bool)
    for at, edge in enumerate(_BLOCKS):
        if at:
            near = _halved(near, shape, edge)
        block = np.argwhere(near)
        half_m = 0.5 * (edge - 1) * voxel_m  # from the block's centre to those of its outermost voxels
        centres_m = origin_m + (block + 0.5) * edge * voxel_m
        near[tuple(block.T)] = (
            scene.fixed_distance_m(centres_m) <= reach_m + math.sqrt(3.0) * half_m + _SAME_M
        )
    return np.flatnonzero(_halved(near, shape, 1))


def _halved(blocks: Bool, shape: tuple[int, ...], edge: int) -> Bool:
    """Flags of blocks of twice this edge as flags of the blocks of this edge that cover the voxels."""
    fine: Bool = blocks.repeat(2, 0).repeat(2, 1).repeat(2, 2)
    return fine[tuple(slice(math.ceil(n / edge)) for n in shape)]


@option
class Known(FieldParameters):
    """The true fixed geometry as a voxel map, complete with the first update."""

    occupied_below_m: NonNegative = 0.025  # m; signed distance of a voxel's centre below which it is
    # occupied, as of a measured map [ours]
    _scene: Scene | None = dataclasses.field(default=None, init=False, repr=False)
    _esdf: SignedDistance = dataclasses.field(init=False, repr=False)
    _field: DistanceField = dataclasses.field(init=False, repr=False)
    _tiles: Int32 = dataclasses.field(init=False, repr=False)
    _made: UInt8 = dataclasses.field(init=False, repr=False)  # state as of the next update
    _state: UInt8 = dataclasses.field(init=False, repr=False)  # of the field

    def __post_init__(self) -> None:
        FieldParameters.__post_init__(self)
        require(
            self.occupied_below_m < 0.5 * self.voxel_size_m,
            f"occupied_below_m must be below half of voxel_size_m = {self.voxel_size_m}, "
            f"got {self.occupied_below_m}",
        )

    def reset(self, bounds_m: Float, scene: Scene) -> None:
        """Begin a trial in `scene` inside `bounds_m` (2, 3); unknown until a ball is marked free.

        Raises:
            WorldError: the map would need more than `max_memory_mb`.
        """
        shape = grid_shape(bounds_m, self.voxel_size_m, self.max_memory_mb, _BYTES_PER_VOXEL)
        self._scene = scene
        self._esdf = SignedDistance(shape, self.voxel_size_m, self.max_distance_m)
        self._made, self._state = np.zeros(shape, np.uint8), np.zeros(shape, np.uint8)
        self._tiles = no_changes(shape)
        self._field = DistanceField(
            origin_m=np.array(bounds_m[0], dtype=np.float64),
            voxel_size_m=self.voxel_size_m,
            max_distance_m=self.max_distance_m,
            distance=self._esdf.distance,
            state=self._state,
            changed=self._tiles,
        )

    def mark_free(self, centre_m: Float, radius_m: float) -> None:
        """Make the map: free is the air that holds a point, for which it has to lie in the bounds."""
        scene, shape = self._begun(), self._made.shape
        distance_m, crossed = self._measured(scene)
        inside = np.clip(
            (np.asarray(centre_m) - self._field.origin_m) / self.voxel_size_m, 0, np.array(shape) - 1
        )
        x, y, z = (int(i) for i in inside)
        reached = _air(crossed, (x, y, z))
        air = (reached == 1) & (distance_m >= self.occupied_below_m)
        self._made = np.where(air, FREE, OCCUPIED).astype(np.uint8)
        _sheets(crossed, reached, distance_m, _SAME_M, self._made)

    def note_obstacle(self, centre_m: Float, radius_m: float) -> None:
        """Declare a ball an obstacle that was felt."""
        self._made.reshape(-1)[ball(self._field, centre_m, radius_m)] = OCCUPIED

    def integrate(self, scan: Scan) -> None:
        """Learn nothing: all is known."""

    def update(self, time_s: float) -> MapUpdate:
        """Return what changed since the last call: everything, first seen, at the first one."""
        self._begun()
        before, after = self._state.reshape(-1), self._made.reshape(-1)
        flipped = np.flatnonzero((before == OCCUPIED) != (after == OCCUPIED)).astype(np.int32)
        first_seen = np.flatnonzero((before == 0) & (after != 0)).astype(np.int32)
        before[:] = after
        update = self._esdf.update(time_s, self._state, flipped, first_seen)
        count_changes(update.voxel, self._state.shape, self._tiles)
        return update

    @property
    def field(self) -> DistanceField:
        """The distance field, as of the last `update`."""
        self._begun()
        return self._field

    def _begun(self) -> Scene:
        if self._scene is None:
            raise RuntimeError("reset() must come first")
        return self._scene

    def _measured(self, scene: Scene) -> tuple[Float32, UInt8]:
        """Distance of the voxel centres to the surfaces, m, and which steps up (bit: axis) cross one.

        It is exact where a surface is within a voxel's edge, and infinite elsewhere.
        """
        shape, reach_m = self._made.shape, self.voxel_size_m + _SAME_M
        centres_m = self._field.voxel_centres_m(np.arange(self._made.size))
        distance_m = np.full(self._made.size, np.inf, np.float32)
        near = _near_surfaces(scene, self._field.origin_m, self.voxel_size_m, shape, reach_m)
        distance_m[near] = scene.fixed_distance_m(centres_m[near])
        near = near[distance_m[near] <= reach_m]
        rays = np.zeros((near.size, 6), np.float32)
        rays[:, :3] = centres_m[near]
        crossed = np.zeros(self._made.size, np.uint8)
        for axis in range(3):
            rays[:, 3:] = self.voxel_size_m * np.eye(3)[axis]
            hit, _ = scene.fixed_cast(rays)
            crossed[near[hit <= 1.0]] |= np.uint8(1 << axis)
        grid = crossed.reshape(shape)
        for axis in range(3):  # the last ones have no neighbour
            np.moveaxis(grid, axis, 0)[-1] &= np.uint8(~(1 << axis) & 0xFF)
        return distance_m.reshape(shape), grid

"""Questions to the true geometry: rays, distances, and whether a box touches it.

Rays and distances to fixed surfaces come from Open3D's RaycastingScene on one thread (Embree,
float32); movers are met in closed form (`bodies`), and touching is exact in float64
(`triangle_grid`, `bodies`). Without movers nothing is added to any answer.
"""

from __future__ import annotations

from typing import cast

import numpy as np

from uavexp import triangle_grid
from uavexp.arrays import Float, Float32, Int, Int32
from uavexp.bodies import cast_rays, distance_m, touching
from uavexp.o3d import open3d
from uavexp.space import Space
from uavexp.types import Bodies, World

_THREADS = 1  # records must not depend on the machine


class Scene:
    """The true geometry of a world: fixed surfaces, and the movers where they were last placed.

    Args:
        world: its `vertices_m` and `triangles`; none at all means empty space.
    """

    __slots__ = ("_grid", "_raycasting", "bodies", "space", "triangles", "vertices_m")

    def __init__(self, world: World) -> None:
        self._build(world.vertices_m, world.triangles)
        self.space = world.space

    @classmethod
    def from_mesh(cls, vertices_m: Float32, triangles: Int32) -> Scene:
        """Return the scene of vertices (V, 3) and triangles (F, 3), before there is a `World`."""
        scene = cls.__new__(cls)
        scene._build(vertices_m, triangles)
        return scene

    def _build(self, vertices_m: Float32, triangles: Int32) -> None:
        self.vertices_m = np.ascontiguousarray(vertices_m, dtype=np.float32)
        self.triangles = np.ascontiguousarray(triangles, dtype=np.int32)
        self._grid: triangle_grid.TriangleGrid | None = None
        self._raycasting = None
        self.bodies = Bodies.none()
        self.space = Space.all_free()
        if self.triangles.shape[0] > 0:
            self._raycasting = open3d.t.geometry.RaycastingScene(nthreads=_THREADS)
            self._raycasting.add_triangles(
                open3d.core.Tensor(self.vertices_m), open3d.core.Tensor(self.triangles.astype(np.uint32))
            )

    def place(self, bodies: Bodies) -> None:
        """Put the movers where they are now."""
        self.bodies = bodies

    def cast(self, rays: Float32) -> tuple[Float32, Float32]:
        """Intersect rays with the nearest surface, fixed or a mover's.

        Args:
            rays: origin and direction (N, 6), m; directions of any length > 0.

        Returns:
            Ray parameter (N,) in units of the direction, inf on a miss; unit normal of the
            triangle hit (N, 3), either side, or of the mover hit, outward; 0 on a miss.
        """
        hit, normal = self.fixed_cast(rays)
        if len(self.bodies):
            cast_rays(self.bodies, rays, hit, normal)
        return hit, normal

    def fixed_cast(self, rays: Float32) -> tuple[Float32, Float32]:
        """The same with fixed surfaces alone."""
        if self._raycasting is None:
            return _nothing_met(len(rays))
        hits = self._raycasting.cast_rays(_tensor(rays), nthreads=_THREADS)
        return hits["t_hit"].numpy(), hits["primitive_normals"].numpy()

    def cast_movers(self, rays: Float32) -> tuple[Float32, Float32]:
        """The same with movers alone."""
        hit, normal = _nothing_met(len(rays))
        cast_rays(self.bodies, rays, hit, normal)
        return hit, normal

    def distance_m(self, points_m: Float) -> Float:
        """Unsigned distance (N,) of points (N, 3) to the nearest surface or mover, m; inf in empty space."""
        fixed_m = self.fixed_distance_m(points_m)
        return np.minimum(fixed_m, distance_m(self.bodies, points_m)) if len(self.bodies) else fixed_m

    def fixed_distance_m(self, points_m: Float) -> Float:
        """The same to fixed surfaces alone."""
        if self._raycasting is None:
            return np.full(points_m.shape[0], np.inf)
        distance = self._raycasting.compute_distance(_tensor(points_m), nthreads=_THREADS)
        return cast(Float, distance.numpy().astype(np.float64))

    def fixed_clearance_m(self, points_m: Float) -> Float:
        """The same with its sign: negative (N,) inside of a solid, or of what counts as one."""
        distance_m = self.fixed_distance_m(points_m)
        return np.where(self.space.is_solid(points_m), -distance_m, distance_m)

    def fixed_closest_point_m(self, points_m: Float) -> Float:
        """Nearest point (N, 3) on a fixed surface of points (N, 3), m; inf in empty space."""
        if self._raycasting is None:
            return np.full((points_m.shape[0], 3), np.inf)
        closest = self._raycasting.compute_closest_points(_tensor(points_m), nthreads=_THREADS)
        return cast(Float, closest["points"].numpy().astype(np.float64))

    def touches(self, position_m: Float, rotation: Float, size_m: Float, margin_m: float = 0.0) -> bool:
        """Whether an oriented box meets a surface or a mover, exactly.

        A box wholly inside a fixed solid meets no surface (`fixed_clearance_m` tells); one inside a
        mover does meet it.

        Args:
            position_m: centre of the box (3,).
            rotation: box to world (3, 3).
            size_m: length, width, height (3,).
            margin_m: added on every side, >= 0.
        """
        if self.touches_fixed(position_m, rotation, size_m, margin_m):
            return True
        return len(self.bodies) > 0 and len(self.touched_movers(position_m, rotation, size_m, margin_m)) > 0

    def touches_fixed(self, position_m: Float, rotation: Float, size_m: Float, margin_m: float = 0.0) -> bool:
        """The same with fixed surfaces alone."""
        if self._raycasting is None:
            return False
        half = 0.5 * np.asarray(size_m, dtype=np.float64) + margin_m
        return bool(triangle_grid.box_meets_mesh(self.grid, position_m, rotation, half))

    def touched_movers(self, position_m: Float, rotation: Float, size_m: Float, margin_m: float = 0.0) -> Int:
        """Which movers (K,) the box meets, ascending."""
        half = 0.5 * np.asarray(size_m, dtype=np.float64) + margin_m
        return touching(self.bodies, position_m, rotation, half)

    @property
    def grid(self) -> triangle_grid.TriangleGrid:
        """The triangles (at least one) sorted into cells, for numba kernels; built at first use."""
        if self._grid is None:
            self._grid = triangle_grid.build(self.vertices_m, self.triangles)
        return self._grid


def _nothing_met(count: int) -> tuple[Float32, Float32]:
    """The answer of so many rays into empty space."""
    return np.full(count, np.inf, np.float32), np.zeros((count, 3), np.float32)


def _tensor(array: Float | Float32) -> object:
    """Wrap rows of numbers as a float32 tensor, without a copy when they are float32 already."""
    return open3d.core.Tensor.from_numpy(np.ascontiguousarray(array, dtype=np.float32))

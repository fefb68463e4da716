"""What a pinhole camera truly sees: inverse depth of every pixel, and the plane it looks at.

A mesh is drawn triangle by triangle (`raster`) or met by a ray through every pixel (Embree), whichever
is cheaper: drawing costs by the triangle, rays by the pixel. With 4 thousand to a million triangles and
32 x 24 to 640 x 480 pixels, both took the same time at 4 to 7 triangles a pixel; at one triangle a pixel
drawing took a third, at twenty double. Movers are always met by rays.
"""

from __future__ import annotations

import numba as nb
import numpy as np

from uavexp.arrays import Float, Float32
from uavexp.scene import Scene
from uavexp.sensor.raster import rasterise

TRIANGLES_PER_PIXEL = 5  # beyond this, rays


@nb.njit(cache=True)
def _aim(directions: Float32, origin_m: Float, rotation: Float, rays: Float32) -> None:
    """Write rays (N, 6) of camera-frame directions (N, 3) from a pose to `rays`."""
    for n in range(directions.shape[0]):
        x, y, z = directions[n, 0], directions[n, 1], directions[n, 2]
        for axis in range(3):
            rays[n, axis] = origin_m[axis]
            rays[n, 3 + axis] = rotation[axis, 0] * x + rotation[axis, 1] * y + rotation[axis, 2] * z


@nb.njit(cache=True, error_model="numpy")
def _lay_over(depth: Float32, normal: Float32, rays: Float32, inverse: Float32, plane_m: Float32) -> None:
    """Lay what rays have met over an image (H, W), where it is nearer."""
    for n in range(depth.shape[0]):
        value = np.float32(1.0) / depth[n]
        v, u = divmod(n, inverse.shape[1])
        if value > inverse[v, u]:
            along = normal[n, 0] * rays[n, 3] + normal[n, 1] * rays[n, 4] + normal[n, 2] * rays[n, 5]
            inverse[v, u], plane_m[v, u] = value, abs(along) * depth[n]


class TrueDepth:
    """The images of one camera in one scene, each in place of the last.

    Attributes:
        inverse: (H, W) 1 / depth along the optical axis, 1 / m; 0 where nothing is met.
        plane_m: (H, W) the camera's distance from the plane of what is met.
        slant: (H, W) length of the ray to a pixel, over its depth.
    """

    def __init__(self, scene: Scene, shape: tuple[int, int], intrinsics: Float) -> None:
        """Prepare.

        Args:
            scene: the true geometry.
            shape: rows and columns of the image.
            intrinsics: (4,) fx, fy, cx, cy, px.
        """
        self._scene, self._intrinsics = scene, intrinsics
        self.inverse, self.plane_m = np.empty(shape, np.float32), np.empty(shape, np.float32)
        fx, fy, cx, cy = intrinsics
        v, u = np.indices(shape)
        # z = 1: the ray parameter is the depth along the optical axis
        directions = np.stack([(u - cx) / fx, (v - cy) / fy, np.ones(shape)], axis=-1)
        self.slant: Float32 = np.linalg.norm(directions, axis=-1).astype(np.float32)
        self._directions = directions.reshape(-1, 3).astype(np.float32)
        self._rays = np.empty((u.size, 6), np.float32)
        self._drawn = len(scene.triangles) <= TRIANGLES_PER_PIXEL * u.size
        self._seen = np.empty((len(scene.vertices_m), 3))

    def take(self, position_m: Float, rotation: Float) -> None:
        """Fill the image from a position (3,) with a camera-to-world rotation (3, 3)."""
        scene = self._scene
        if self._drawn:
            rasterise(
                scene.vertices_m, scene.triangles, self._intrinsics, position_m, rotation, self._seen,
                self.inverse, self.plane_m,
            )  # fmt: skip
        else:
            self.inverse[:] = 0.0
        if not self._drawn or len(scene.bodies):
            _aim(self._directions, position_m, rotation, self._rays)
            depth, normal = (scene.cast_movers if self._drawn else scene.cast)(self._rays)
            _lay_over(depth, normal, self._rays, self.inverse, self.plane_m)

"""The kernels of the dense backend against the formulas of `occupancy`, written plainly over all voxels."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.maps import NOTHING
from uavexp.field import FREE, OCCUPIED, UNKNOWN
from uavexp.geometry import rotation_from_quaternion
from uavexp.mapping.dense import Dense
from uavexp.scan import DepthScan

EXTENT_M = np.array([3.0, 2.6, 1.7])
RANGE_M = 2.0
TIE = 1e-4  # px, m: what lies so near to the border between two answers may get either


def scan_of(rng: np.random.Generator, size: tuple[int, int]) -> DepthScan:
    """A scan from anywhere in the map or near it: slopes and steps, with misses and gaps."""
    quaternion = rng.normal(size=4) * [1.0, 0.2, 0.2, 1.0] if rng.random() < 0.5 else rng.normal(size=4)
    v, u = np.indices(size)
    depth = rng.uniform(0.3, 3.0) + rng.uniform(-0.05, 0.05) * u + rng.uniform(-0.05, 0.05) * v
    depth = np.where(rng.random() < 0.5, depth, rng.uniform(0.2, 4.0, size))
    depth[rng.random(size) < 0.1] = np.nan
    depth[(rng.random(size) < 0.2) | (depth > RANGE_M)] = np.inf
    depth[depth <= 0.1] = np.nan
    focal = rng.uniform(0.4, 1.2, 2) * size[1]
    return DepthScan(
        time_s=0.0,
        depth_m=depth.astype(np.float32),
        focal_px=(focal[0], focal[1]),
        centre_px=tuple(rng.uniform(0.3, 0.7, 2) * (size[1] - 1, size[0] - 1)),
        max_range_m=RANGE_M,
        camera_position_m=rng.uniform(-0.3, 1.2, 3) * EXTENT_M,
        camera_rotation=rotation_from_quaternion(quaternion / np.linalg.norm(quaternion)),
    )


class Plain:
    """The rule in float64, voxel by voxel; `sure` where no answer hung on rounding."""

    def __init__(self, backend: Dense) -> None:
        self.option, shape = backend, backend.field.state.shape
        self.tsdf_m, self.weight, self.evidence = np.zeros(shape), np.zeros(shape, int), np.zeros(shape, int)
        self.state, self.sure = np.full(shape, UNKNOWN), np.ones(shape, bool)
        index = np.stack(np.meshgrid(*map(np.arange, shape), indexing="ij"), axis=-1)
        self.centre_m = backend.field.origin_m + (index + 0.5) * backend.voxel_size_m

    def above(self, value: np.ndarray, limit: float | np.ndarray) -> np.ndarray:
        self.sure &= ~(np.abs(value - limit) < TIE)
        return value > limit

    def integrate(self, scan: DepthScan) -> None:
        option = self.option
        x, y, z = np.moveaxis((self.centre_m - scan.camera_position_m) @ scan.camera_rotation, -1, 0)
        with np.errstate(divide="ignore", invalid="ignore"):
            u = scan.focal_px[0] * x / z + scan.centre_px[0] + 0.5
            v = scan.focal_px[1] * y / z + scan.centre_px[1] + 0.5
        height, width = scan.depth_m.shape
        ahead = self.above(z, 0.0)
        for at in (u, v):
            self.sure &= ~(ahead & (np.abs(at - np.rint(at)) < TIE))
        ahead &= (u >= 0) & (v >= 0) & (u < width) & (v < height)
        depth = np.full(z.shape, np.nan)
        depth[ahead] = scan.depth_m[v[ahead].astype(int), u[ahead].astype(int)]
        with np.errstate(invalid="ignore"):
            d = depth - z
            told = self.above(d, -option.truncation_m) & ~(
                self.above(z, scan.max_range_m) & self.above(d, 0.0)
            )
            d = np.minimum(d, option.truncation_m)
            self.observe(d, told)

    def observe(self, d: np.ndarray, told: np.ndarray) -> None:
        option, low, high = self.option, self.option.occupied_below_m, self.option.free_above_m
        told = told & ~(
            self.above(-d, high) & self.above(self.tsdf_m, high) & (self.weight >= 2) & (self.evidence == 0)
        )
        mean = (self.weight * self.tsdf_m + d) / (self.weight + 1)
        contradicts = (self.weight > 0) & self.above(np.abs(d - self.tsdf_m), high)
        judged = np.where(contradicts, d, mean)
        deep = self.above(-judged, option.solid_depth_m)
        hit, clear = ~self.above(judged, low), self.above(judged, high) | (self.state != OCCUPIED)
        evidence = np.where(
            hit, self.evidence + option.hit_evidence, self.evidence - option.miss_evidence * clear
        )
        evidence = evidence.clip(0, option.max_evidence)
        state = np.where(
            evidence >= option.occupied_evidence, OCCUPIED, np.where(evidence == 0, FREE, self.state)
        )
        moved = told & ~deep
        self.evidence, self.state = (
            np.where(moved, evidence, self.evidence),
            np.where(moved, state, self.state),
        )
        self.tsdf_m = np.where(told, mean, self.tsdf_m)
        self.weight = np.where(told, np.minimum(self.weight + 1, option.max_weight), self.weight)


@settings(deadline=None, max_examples=60)
@given(st.integers(0, 2**32 - 1), st.tuples(st.integers(1, 30), st.integers(1, 40)))
@pytest.mark.parametrize("height_m", [0.1, 0.85, 1.7])
def test_every_voxel_is_what_the_formulas_say(height_m: float, seed: int, size: tuple[int, int]) -> None:
    """From inside and outside; views of all, of a part of and of no voxel; images down to one pixel."""
    rng, backend = np.random.default_rng(seed), Dense(max_weight=5)
    backend.reset(np.array([[-0.3, 0.2, 0.1], [-0.3, 0.2, 0.1] + EXTENT_M * [1, 1, height_m / 1.7]]), NOTHING)
    plain, grid = Plain(backend), backend._live()
    for _ in range(8):
        scan = scan_of(rng, size)
        backend.integrate(scan)
        plain.integrate(scan)
    backend.update(0.0)
    sure = plain.sure
    assert sure.mean() > 0.9
    shape = grid.shape
    np.testing.assert_array_equal(grid.voxels.weight.reshape(shape)[sure], plain.weight[sure])
    np.testing.assert_array_equal(backend.field.state[sure], plain.state[sure])
    np.testing.assert_array_equal((grid.voxels.live.reshape(shape) >> 3)[sure], plain.evidence[sure])
    np.testing.assert_allclose(grid.voxels.tsdf_m.reshape(shape)[sure], plain.tsdf_m[sure], atol=1e-5)

"""From the true depth z along the optical axis to the measured one: the noise of a structured-light sensor.

In this order:

1. missing returns at grazing angles: none where the angle between the ray and the normal of
   a surface within range exceeds `grazing_angle_deg`;
2. axial noise: z + N(0, sigma(z)), sigma(z) = 0.0012 + 0.0019 (z - 0.4)^2 m (Nguyen, Izadi
   and Lovell 2012, "Modeling Kinect Sensor Noise", axial noise up to 60°);
3. disparity quantisation: d = f b / z rounded to a multiple of `disparity_step_px`
   (Khoshelham and Elberink 2012: 1/8 px; b = 0.075 m, f = 580 px of its infrared camera);
4. missing returns at depth edges: a pixel at which inverse depth (linear over the image of
   any plane) has a second difference of more than `edge_ratio` of its largest value among
   the neighbours has none, with probability `edge_missing_probability`, on both sides;
5. range: below `min_range_m` (before quantisation) is NaN; beyond `max_range_m`, or no surface at
   all, is +inf.

A missing return is NaN. All is computed in float32 from inverse depth, as the image is drawn.
"""

from __future__ import annotations

from typing import NamedTuple

import numba as nb
import numpy as np

from uavexp.arrays import Float32

_NEAREST_M, _GROWTH_PER_M, _BEST_M = np.float32(0.0012), np.float32(0.0019), np.float32(0.4)  # of sigma(z)
_ONE, _TWO, _HALF = np.float32(1.0), np.float32(2.0), np.float32(0.5)


class DepthNoise(NamedTuple):
    """The terms as kernels take them."""

    min_range_m: np.float32
    max_range_m: np.float32
    axial: np.float32  # 1, or 0: no axial noise
    disparity_unit_m: np.float32  # f b / step; 0: not quantised
    edge_ratio: np.float32
    edge_probability: np.float32  # 0: no missing returns at edges
    least_cosine: np.float32  # between ray and normal; 0: no missing returns at grazing angles


@nb.njit(cache=True, error_model="numpy")
def error_bound_m(depth_m: float, noise: DepthNoise) -> float:
    """How far a measured depth may be off the true one: three sigma, and half a step of disparity there."""
    off_m = depth_m - _BEST_M
    bound_m = 3.0 * noise.axial * (_NEAREST_M + _GROWTH_PER_M * off_m * off_m)
    if noise.disparity_unit_m > 0.0:
        bound_m += 0.5 * depth_m * depth_m / noise.disparity_unit_m
    return float(bound_m)


@nb.njit(cache=True, error_model="numpy")
def _drop_edges(
    before: Float32, here: Float32, after: Float32, uniform: Float32, noise: DepthNoise, measured: Float32
) -> None:
    """Drop measurements (N,) where inverse depth jumps between three neighbouring pixels in a line.

    Inverse depth is linear over the image of a plane, however steep: a floor is no edge.
    Nor is anything where all is beyond range.
    """
    least = _ONE / noise.max_range_m
    for n in range(here.shape[0]):
        largest = max(before[n], here[n], after[n])
        bend = abs(before[n] - _TWO * here[n] + after[n])
        dropped = (
            (largest >= least) & (bend > noise.edge_ratio * largest) & (uniform[n] < noise.edge_probability)
        )
        measured[n] = np.float32(np.nan) if dropped else measured[n]


@nb.njit(cache=True, error_model="numpy")
def measure(
    inverse: Float32, plane_m: Float32, slant: Float32, gaussian: Float32, uniform: Float32, noise: DepthNoise
) -> Float32:
    """Measured depth (H, W).

    Args:
        inverse: (H, W) 1 / depth, 1 / m; 0 where there is no surface.
        plane_m: (H, W) the camera's distance from the plane of the surface seen.
        slant: (H, W) length of a pixel's ray over its depth.
        gaussian: (H, W) standard normal draws.
        uniform: (H, W) draws from [0, 1).
        noise: the terms.
    """
    measured = np.empty_like(inverse)
    for v in range(inverse.shape[0]):
        for u in range(inverse.shape[1]):  # no branches: eight pixels at once
            true = _ONE / inverse[v, u]
            sigma = _NEAREST_M + _GROWTH_PER_M * (true - _BEST_M) * (true - _BEST_M)
            noisy = true + noise.axial * sigma * gaussian[v, u]
            depth = noisy
            if noise.disparity_unit_m > 0.0:
                depth = noise.disparity_unit_m / np.floor(noise.disparity_unit_m / noisy + _HALF)
            depth = np.float32(np.inf) if depth > noise.max_range_m else depth
            grazed = (true <= noise.max_range_m) & (
                plane_m[v, u] * inverse[v, u] < noise.least_cosine * slant[v, u]
            )
            missing = grazed | (noisy < noise.min_range_m) | (noisy <= 0.0)
            depth = np.float32(np.nan) if missing else depth
            measured[v, u] = depth if inverse[v, u] > 0.0 else np.float32(np.inf)
    for v in range(inverse.shape[0]):
        here, drawn, row = inverse[v], uniform[v], measured[v]
        _drop_edges(here[:-2], here[1:-1], here[2:], drawn[1:-1], noise, row[1:-1])
        if 0 < v < inverse.shape[0] - 1:
            _drop_edges(inverse[v - 1], here, inverse[v + 1], drawn, noise, row)
    return measured

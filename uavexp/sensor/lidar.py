"""What the LiDARs share: parameters, mounting, and the measurement of ranges along single rays.

From the true range r along a ray to the measured one, in this order:

1. range noise: r + N(0, `range_noise_m`);
2. missing returns: none with probability `missing_probability` (dark, wet or specular spots);
3. range: nearer than `min_range_m` is NaN; beyond `max_range_m`, or no surface at all, is +inf.

One normal and one uniform number is drawn per ray and scan whatever is seen, so that streams
stay aligned. Left out: the vehicle's motion within a scan (all rays start from one pose),
beam divergence, intensity, mixed returns at edges.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated

import numba as nb
import numpy as np

from uavexp.arrays import Float, Float32
from uavexp.errors import require
from uavexp.geometry import rotation_from_quaternion
from uavexp.parameters import NonNegative, Positive, Vector, at_least, below, between
from uavexp.scan import RayScan
from uavexp.scene import Scene
from uavexp.types import State


@dataclass(slots=True, kw_only=True)
class LidarParameters:
    """Parameters that both LiDARs have; no state. The sensor's x points forward, z up."""

    rate_hz: Positive = 10.0  # Hz; scans, as both makers' drivers give them [ours]
    min_range_m: NonNegative = 0.3  # m, nearer surfaces give no measurement [ours]
    max_range_m: Positive = 12.0  # m, farther surfaces are measured as beyond range;
    # the real ones see 100 m and more, a room ends sooner [ours]
    range_noise_m: NonNegative = 0.02  # m, standard deviation; the data sheets' 2 cm
    missing_probability: Annotated[float, at_least(0), below(1)] = 0.0  # of a ray without any
    # measurement [ours]
    mount_offset_m: Vector = (0.0, 0.0, 0.0)  # m, sensor in the body frame: forward, left, up [ours]
    mount_pitch_deg: Annotated[float, between(-90, 90)] = 0.0  # deg, forward axis above (+) or below (-)
    # body x [ours]

    def __post_init__(self) -> None:
        require(
            self.min_range_m < self.max_range_m,
            f"min_range_m must be < max_range_m = {self.max_range_m}, got {self.min_range_m}",
        )

    def pose(self, state: State) -> tuple[Float, Float]:
        """World position (3,) and sensor-to-world rotation (3, 3) of the sensor on a vehicle."""
        body: Float = rotation_from_quaternion(state.quaternion_wxyz)
        pitch = math.radians(self.mount_pitch_deg)
        c, s = math.cos(pitch), math.sin(pitch)
        mount = np.array([[c, 0.0, -s], [0.0, 1.0, 0.0], [s, 0.0, c]])
        return state.position_m + body @ np.array(self.mount_offset_m), body @ mount


@nb.njit(cache=True)
def _aim(direction: Float32, origin_m: Float, rotation: Float, rays: Float32) -> None:
    """Write rays (N, 6) of sensor-frame directions (N, 3) from a pose to `rays`."""
    for n in range(direction.shape[0]):
        for axis in range(3):
            rays[n, axis] = origin_m[axis]
            rays[n, 3 + axis] = (
                rotation[axis, 0] * direction[n, 0]
                + rotation[axis, 1] * direction[n, 1]
                + rotation[axis, 2] * direction[n, 2]
            )


@nb.njit(cache=True)
def _measure(
    true_m: Float32, gaussian: Float32, uniform: Float32, noise_m: float, missing: float,
    min_range_m: float, max_range_m: float,
) -> Float32:  # fmt: skip
    """Measured ranges (N,) of true ones; see the module's list of terms."""
    measured = np.empty(true_m.shape[0], np.float32)
    for n in range(true_m.shape[0]):
        range_m = true_m[n] + noise_m * gaussian[n]
        if uniform[n] < missing or range_m < min_range_m or range_m <= 0.0:
            range_m = np.nan
        elif range_m > max_range_m:
            range_m = np.inf
        measured[n] = range_m
    return measured


def take_scan(
    lidar: LidarParameters,
    direction: Float32,
    scene: Scene,
    rng: np.random.Generator,
    states: tuple[State, State],
    time_s: float,
) -> RayScan:
    """Measure ranges along rays.

    Args:
        lidar: its parameters.
        direction: (N, 3) unit directions in the sensor's frame.
        scene: the true geometry.
        rng: draws the noise.
        states: of the vehicle, in truth and as believed: measured from the one, told of the other.
        time_s: of the scan.
    """
    true_state, believed_state = states
    rays = np.empty((direction.shape[0], 6), np.float32)
    _aim(direction, *lidar.pose(true_state), rays)
    true_m, _ = scene.cast(rays)
    count = direction.shape[0]
    range_m = _measure(
        true_m, rng.standard_normal(count, dtype=np.float32), rng.random(count, dtype=np.float32),
        lidar.range_noise_m, lidar.missing_probability, lidar.min_range_m, lidar.max_range_m,
    )  # fmt: skip
    origin_m, rotation = lidar.pose(believed_state)
    if believed_state is not true_state:
        _aim(direction, origin_m, rotation, rays)
    return RayScan(
        time_s=time_s,
        origin_m=origin_m,
        direction=np.ascontiguousarray(rays[:, 3:]),
        range_m=range_m,
        max_range_m=lidar.max_range_m,
    )

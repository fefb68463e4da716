"""Times of the map backends on scans taken along a warehouse's shortest path.

    python benchmarks/mapping_bench.py

prints integration and ESDF update times, and how much faster the update is than
scipy's exact transform of the whole map. `measure` also takes any other list of scans.
"""

from __future__ import annotations

import time

import numpy as np
from scipy.ndimage import distance_transform_edt

from uavexp.arrays import Float
from uavexp.field import OCCUPIED
from uavexp.geometry import quaternion_from_yaw
from uavexp.mapping.base import MapBackend
from uavexp.mapping.dense import Dense
from uavexp.mapping.projection import Band, Projection
from uavexp.mapping.voxel_block_grid import VoxelBlockGrid
from uavexp.scan import DepthScan
from uavexp.scene import Scene
from uavexp.seeding import Stream, generator
from uavexp.sensor.rgbd import Rgbd
from uavexp.types import State, World
from uavexp.world.warehouse import Warehouse

SPEED_MPS = 1.2
NOTHING = Scene.from_mesh(np.zeros((0, 3), np.float32), np.zeros((0, 3), np.int32))


def milliseconds(seconds: list[float]) -> dict[str, float]:
    """Median, 99 % and least of a list of times."""
    times = 1e3 * np.array(seconds)
    return {
        "median": float(np.median(times)),
        "p99": float(np.percentile(times, 99)),
        "min": float(times.min()),
    }


def scipy_ms(occupied: np.ndarray, repeats: int = 3) -> float:
    """Least time of scipy's exact transform of a whole map."""
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        distance_transform_edt(~occupied)
        times.append(time.perf_counter() - start)
    return 1e3 * min(times)


def measure(
    backend: MapBackend, bounds_m: Float, scans: list[DepthScan], scans_per_update: int = 2
) -> dict[str, float]:
    """Fuse the scans, updating the ESDF after every `scans_per_update`-th, and time it all.

    Returns:
        integrate_ms_*, esdf_update_ms_* (median, p99, min), project_ms_median, scipy_ms and
        esdf_speedup_over_scipy (scipy's time over the median update), changed_voxels_median.
    """
    for timed in (False, True):  # the first round compiles
        backend.reset(bounds_m, NOTHING)
        backend.mark_free(scans[0].camera_position_m, 0.6)
        height = float(scans[0].camera_position_m[2])
        band = Band(z_min_m=height - 0.2, z_max_m=height + 0.2, flight_height_m=height, occupied_below_m=0.3)
        projection = Projection(backend.field, band)
        integrate, update, plane, changed = [], [], [], []
        for n, scan in enumerate(scans if timed else scans[:20]):
            start = time.perf_counter()
            backend.integrate(scan)
            integrate.append(time.perf_counter() - start)
            if n % scans_per_update == scans_per_update - 1:
                start = time.perf_counter()
                log = backend.update(scan.time_s)
                update.append(time.perf_counter() - start)
                changed.append(log.voxel.size)
                start = time.perf_counter()
                projection.update()
                plane.append(time.perf_counter() - start)
    whole = scipy_ms(backend.field.state == OCCUPIED)
    result = {f"integrate_ms_{key}": value for key, value in milliseconds(integrate).items()}
    result |= {f"esdf_update_ms_{key}": value for key, value in milliseconds(update).items()}
    return result | {
        "project_ms_median": milliseconds(plane)["median"],
        "scipy_ms": whole,
        "esdf_speedup_over_scipy": whole / result["esdf_update_ms_median"],
        "changed_voxels_median": float(np.median(changed)),
    }


def scans_along(world: World, sensor: Rgbd, seed: int = 0) -> list[DepthScan]:
    """Scans of a flight along the shortest path at constant speed, looking ahead."""
    sensor.reset(Scene(world), generator(seed, Stream.SENSOR))
    path = world.shortest_path
    at = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])
    scans = []
    for time_s in np.arange(0.0, at[-1] / SPEED_MPS, 1.0 / sensor.rate_hz):
        here, ahead = (
            np.array([np.interp(length, at, path[:, axis]) for axis in range(3)])
            for length in (time_s * SPEED_MPS, time_s * SPEED_MPS + 0.8)
        )
        yaw = float(np.arctan2(ahead[1] - here[1], ahead[0] - here[0]))
        state = State(
            position_m=here,
            velocity_mps=np.zeros(3),
            quaternion_wxyz=quaternion_from_yaw(yaw),
            body_rate_radps=np.zeros(3),
        )
        scans.append(sensor.capture(state, state, float(time_s)))
    return scans


def main() -> None:
    """Print the times of both backends."""
    world = Warehouse().generate(generator(0, Stream.WORLD))
    for size in ((96, 72), (160, 120)):
        scans = scans_along(world, Rgbd(width_px=size[0], height_px=size[1]))
        for backend in (Dense(), VoxelBlockGrid()):
            result = measure(backend, world.bounds_m, scans)
            shape = "x".join(str(n) for n in backend.field.distance.shape)
            print(f"{type(backend).__name__}, {size[0]}x{size[1]} px, {len(scans)} scans, map {shape}")
            for key, value in result.items():
                print(f"  {key:28s} {value:10.3f}")


if __name__ == "__main__":
    main()

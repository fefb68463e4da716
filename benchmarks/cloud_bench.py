"""Counts of the cloud pipeline (paper 2, §3) on a simulated scan and on real ones.

    python -m benchmarks.cloud_bench

Prints a table of Markdown: a simulated scan of the `multilevel` hall (world seed 0, 12 poses, noise of
4 mm, as many points as the paper's scan), and the recordings of ../shared/data where that is there.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from uavexp.arrays import Float
from uavexp.cloud.cloud_file import read_cloud
from uavexp.cloud.pipeline import CloudPipeline
from uavexp.cloud.simulated_scan import simulated_scan
from uavexp.o3d import open3d
from uavexp.scene import Scene
from uavexp.seeding import Stream, generator
from uavexp.world.multilevel import Multilevel

DATA = Path("../shared/data")
POSES, RAYS, RANGE_M, NOISE_M = 12, 10_832, 12.0, 0.004


def hall() -> Float:
    """A scan from poses spread over the storeys, each as far from everything as can be drawn."""
    made = Multilevel()
    world = made.generate(generator(0, Stream.WORLD))
    scene, rng = Scene(world), np.random.default_rng(0)
    poses = []
    for storey in range(POSES):
        base_m = made.deck_heights_m()[storey % made.storeys]
        low, high = np.array([0.5, 0.5, base_m + 0.5]), np.array([12.2, 5.5, base_m + 1.7])
        drawn = rng.uniform(low, high, (200, 3))
        poses.append(drawn[int(np.argmax(scene.distance_m(drawn)))])
    return simulated_scan(scene, np.array(poses), RAYS, RANGE_M, NOISE_M, rng)


def frames(folder: Path) -> Float:
    """Points of all depth images of a recording in the axes of its first frame."""
    (fx, _, cx), (_, fy, cy), _ = np.loadtxt(folder / "intrinsics.txt")
    points = []
    for line in (folder / "poses.txt").read_text().splitlines():
        if line.startswith("#"):
            continue
        number, *values = line.split()
        pose = np.array(values, dtype=np.float64).reshape(3, 4)
        depth = np.asarray(open3d.io.read_image(str(folder / f"{int(number):06d}.depth.png")))[::4, ::4]
        v, u = np.nonzero((depth > 0) & (depth < 4000))
        z = depth[v, u] / 1000.0
        camera = np.column_stack([(4.0 * u - cx) / fx * z, (4.0 * v - cy) / fy * z, z])
        points.append(camera @ pose[:, :3].T + pose[:, 3])
    return np.concatenate(points)


def clouds() -> Iterator[tuple[str, Float, float, tuple[float, float, float] | None]]:
    """Name, points, edge of a voxel and true dimensions."""
    yield "simulated multilevel hall", hall(), 0.03, (12.78, 6.06, 8.46)
    for name, edge_m in (("octomap_freiburg079/voxels.npz", 0.1), ("falcon_darpa_tunnel/mesh.ply", 0.1)):
        if (DATA / "worlds" / name).is_file():
            yield name, read_cloud(DATA / "worlds" / name), edge_m, None
    if (DATA / "rgbd/sevenscenes_a").is_dir():
        yield "rgbd/sevenscenes_a, fused", frames(DATA / "rgbd/sevenscenes_a"), 0.03, None


def main() -> None:
    """Print the table."""
    print(
        "| cloud | points | outliers | in planes | vertical | horizontal | voxel m | voxels | specks | "
        "dimensions m | deviation | s |\n" + "|---" * 12 + "|"
    )
    for name, points_m, edge_m, truth_m in clouds():
        began_s = time.perf_counter()
        counts = CloudPipeline(voxel_size_m=edge_m, seed=0).run(points_m, truth_m).counts
        spent_s = time.perf_counter() - began_s
        size = " × ".join(f"{value:.2f}" for value in counts.dimensions_m)
        off = "–" if counts.deviation is None else f"{100.0 * np.max(counts.deviation):.1f} %"
        print(
            f"| {name} | {counts.points:,} | {counts.outliers:,} | {100 * counts.planar_share:.1f} % | "
            f"{100 * counts.vertical_share:.1f} % | {100 * counts.horizontal_share:.1f} % | {edge_m:g} | "
            f"{counts.voxels:,} | {counts.specks:,} | {size} | {off} | {spent_s:.1f} |",
            flush=True,
        )


if __name__ == "__main__":
    main()

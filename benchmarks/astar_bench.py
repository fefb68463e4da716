"""Voxel A* in a hall of several storeys: time against scikit-image, improved against plain.

    python -m benchmarks.astar_bench             speed on 24 million voxels of 0.03 m
    python -m benchmarks.astar_bench --improved  improved against plain, voxels of 0.15 m

Scene and pairs are fixed: world seed 0, 50 pairs at least 3 m apart, drawn with seed 0. Obstacles
are inflated by 0.26 m, the clearance of the planners. Times are processor time of one
thread, a query's least of three. scikit-image is no dependency; without it (pip install
scikit-image) its row is left out. It is asked for two pairs only: it takes the same time for
each, for it always fills the whole grid.
"""

from __future__ import annotations

import sys
import time

import numpy as np

from uavexp.geometry import polyline_length_m
from uavexp.metrics.voxel_path import (
    cumulative_heading_change_rad,
    excess_climb,
    height_reversals,
    mean_heading_change_rad,
)
from uavexp.planner.find.turning import Turning
from uavexp.planner.find.voxels.voxel_grid import VoxelGrid, VoxelPath
from uavexp.planner.find.voxels.waypoints import smoothed
from uavexp.seeding import Stream, generator
from uavexp.world.multilevel import Multilevel
from uavexp.world.voxel_model import inflate, voxel_model

CLEARANCE_M, PAIRS, APART_M, REPEATS, SKIMAGE_PAIRS = 0.26, 50, 3.0, 3, 2


def scene(voxel_m: float) -> np.ndarray:
    """Free cells of the hall, inside its walls."""
    hall = Multilevel()
    world = hall.generate(generator(0, Stream.WORLD))
    occupied, _ = voxel_model(world, voxel_m, np.array([np.zeros(3), hall.size_m]))
    free: np.ndarray = ~inflate(occupied, CLEARANCE_M / voxel_m)
    return free


def pairs(grid: VoxelGrid, voxel_m: float) -> list[tuple[np.ndarray, np.ndarray]]:
    """Joined cells, far enough apart."""
    rng, cells, found = np.random.default_rng(0), np.argwhere(grid.free), []
    while len(found) < PAIRS:
        a, b = cells[rng.integers(len(cells), size=2)]
        if np.linalg.norm(a - b) * voxel_m >= APART_M and grid.shortest(a, b).found:
            found.append((a, b))
    return found


def timed(grid: VoxelGrid, start: np.ndarray, goal: np.ndarray) -> tuple[float, VoxelPath]:
    laps = []
    for _ in range(REPEATS):
        began_s = time.process_time()
        answer = grid.shortest(start, goal)
        laps.append(time.process_time() - began_s)
    return 1e3 * min(laps), answer


def speed() -> None:
    """Time of exact queries on the fine model."""
    voxel_m = 0.03
    VoxelGrid(np.ones((4, 4, 4), dtype=bool)).shortest(np.zeros(3, dtype=int), np.full(3, 3))
    free = scene(voxel_m)
    began_s = time.process_time()
    grid = VoxelGrid(free)
    survey_s = time.process_time() - began_s
    print(f"voxels {free.size / 1e6:.1f} M, free {free.mean():.2f}, survey {survey_s:.2f} s")
    asked = pairs(grid, voxel_m)
    answers = [timed(grid, a, b) for a, b in asked]
    laps = np.array([lap for lap, _ in answers])
    expansions = np.array([answer.expansions for _, answer in answers])
    print(
        f"plain A*: median {np.median(laps):.1f} ms, mean {laps.mean():.1f}, most {laps.max():.0f}; "
        f"expansions median {np.median(expansions):.0f}, most {expansions.max()}; target 63.9 ms"
    )
    try:
        from skimage.graph import route_through_array
    except ImportError:
        print("scikit-image is not installed: no comparison (pip install scikit-image)")
        return
    costs = np.where(free, 1.0, -1.0)
    theirs, ours = [], []
    for n in np.linspace(0, PAIRS - 1, SKIMAGE_PAIRS).astype(int):
        began_s = time.process_time()
        _, cost = route_through_array(costs, *asked[n], fully_connected=True, geometric=True)
        theirs.append(1e3 * (time.process_time() - began_s))
        ours.append(laps[n])
        print(f"scikit-image: {theirs[-1]:.0f} ms (cuts corners: {cost:.2f}), ours {ours[-1]:.1f} ms")
        print(f"  cost without corner cutting {answers[n][1].cost:.2f}")
    print(f"scikit-image over plain A*, medians: {np.median(theirs) / np.median(laps):.0f} x")


def compare() -> None:
    """Improved against plain: raw with raw, smoothed with smoothed."""
    voxel_m = 0.15  # the exact form has up to 156 states a voxel
    free = scene(voxel_m)
    grid = VoxelGrid(free)
    arms = {
        "plain": None,
        "exact": Turning(max_expansions=10**9, form="exact"),
        "exact, open neighbours": Turning(max_expansions=10**9, form="exact", n_horizontal="neighbours"),
        "exact, no rule": Turning(max_expansions=10**9, form="exact", vertical_rule="none"),
        "paper": Turning(max_expansions=10**9, form="paper"),
        "paper, no rule": Turning(max_expansions=10**9, form="paper", vertical_rule="none"),
    }
    rows: dict[str, list[list[float]]] = {name: [] for name in arms}
    for a, b in pairs(grid, voxel_m):
        for name, arm in arms.items():
            began_s = time.process_time()
            answer, remark = (
                (grid.shortest(a, b), "") if arm is None else arm.search(grid, a, b, arm.wish(voxel_m))
            )
            lap_ms = 1e3 * (time.process_time() - began_s)
            raw, curve = answer.centres, smoothed(free, answer.centres)
            rows[name].append(
                [
                    value
                    for path in (raw, curve)
                    for value in (
                        height_reversals(path),
                        voxel_m * excess_climb(path),
                        voxel_m * polyline_length_m(path),
                        np.degrees(cumulative_heading_change_rad(path)),
                        np.degrees(mean_heading_change_rad(path)),
                    )
                ]
                + [lap_ms, float(bool(remark))]
            )
    table = {name: np.array(values) for name, values in rows.items()}
    oscillates = table["plain"][:, 0] > 0
    print(f"{oscillates.sum()} of {PAIRS} queries oscillate under plain A*; means over these, then over all")
    head = ["reversals", "excess_m", "length_m", "heading_deg", "mean_deg"]
    print(" " * 24 + " ".join(f"{'raw ' + word:>15}" for word in head) + "  then smoothed, ms, fallbacks")
    for chosen in (oscillates, np.ones(PAIRS, dtype=bool)):
        for name, values in table.items():
            print(f"{name:24s}" + " ".join(f"{value:9.2f}" for value in values[chosen].mean(axis=0)))


if __name__ == "__main__":
    compare() if "--improved" in sys.argv[1:] else speed()

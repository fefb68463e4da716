"""`make bench`: times of the parts in real flights, real-time factors, memory; outputs/bench.json.

Each flight runs in a process of its own on one thread, after a short flight that loads the
compiled kernels. The same machine gives other times when it is busy, so beside each stands its ratio to
fixed work that the same process did right after: scipy's distance transform of the whole map, Open3D's rays
of one image from the start, a numba loop of a million steps.
"""

from __future__ import annotations

import json
import multiprocessing
import os
import platform
import resource
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numba as nb
import numpy as np
from rich.console import Console
from rich.table import Table

ROOT = Path(__file__).resolve().parents[1]
OFFICE = ROOT.parent / "shared" / "data" / "worlds" / "falcon_complex_office"
MANIFEST = ROOT.parent / "shared" / "data" / "MANIFEST.json"

FLIGHTS: dict[str, dict[str, Any]] = {
    "dense": {"mapping": "dense"},
    "voxel_block_grid": {"mapping": "voxel_block_grid"},
    "dense_160x120": {"mapping": "dense", "sensor.width_px": 160, "sensor.height_px": 120},
}


def office() -> dict[str, Any] | None:
    """Overrides of the first flight in the real office, None where the data is absent."""
    if not MANIFEST.exists():
        return None
    items = json.loads(MANIFEST.read_text())["items"]
    item = next(item for item in items if item["id"] == "falcon_complex_office")
    pair = item["start_goal_pairs"][0]
    return {
        "world": "file",
        "world.path": str(OFFICE / "mesh.ply"),
        "world.start_m": pair["start"],
        "world.target_m": pair["goal"],
        "world.flight_bounds_m": item["flight_bounds"],
    }


def fly(overrides: dict[str, Any]) -> dict[str, Any]:
    """The same flight twice, the second one timed: laps in ms, wall and flown time, memory."""
    from scipy.ndimage import distance_transform_edt

    import uavexp
    from uavexp.config.build import build
    from uavexp.scene import Scene
    from uavexp.trial import fly_trial

    trial = uavexp.fly(strategy="mcr", seed=0, **overrides)
    parts = build(trial.config)
    begin = time.perf_counter()
    world, log = fly_trial(parts, 0)
    wall_s = time.perf_counter() - begin
    return {
        "outcome": str(log.outcome),
        "realtime": float(log.steps.time_s[-1]) / wall_s,
        "laps_ms": {name: (1e3 * laps).tolist() for name, laps in log.wall_s.items()},
        "memory_mib": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0,
        "fixed_ms": {
            "scipy": median_ms(partial(distance_transform_edt, parts.mapping.field.state != 2)),
            "rays": median_ms(partial(Scene(world).cast, rays_from(world.start_m))),
            "loop": median_ms(partial(loop, 1_000_000)),
        },
    }


@nb.njit
def loop(steps: int) -> int:
    """A chain of shifts (Marsaglia's xorshift64) that nothing can shorten."""
    state = np.uint64(1)
    for _ in range(steps):
        state ^= state << np.uint64(13)
        state ^= state >> np.uint64(7)
        state ^= state << np.uint64(17)
    return state


def rays_from(start_m: np.ndarray) -> np.ndarray:
    """64 x 48 rays (N, 6) around the horizon."""
    yaw, pitch = np.meshgrid(np.linspace(0.0, 1.5, 64), np.linspace(-0.5, 0.5, 48))
    ways = np.stack([np.cos(yaw) * np.cos(pitch), np.sin(yaw) * np.cos(pitch), np.sin(pitch)], axis=-1)
    ways = ways.reshape(-1, 3)
    return np.concatenate([np.broadcast_to(start_m, ways.shape), ways], axis=1).astype(np.float32)


def median_ms(work: Callable[[], Any]) -> float:
    """Median time of some work, called before."""
    work()
    laps = []
    for _ in range(9):
        begin = time.perf_counter()
        work()
        laps.append(1e3 * (time.perf_counter() - begin))
    return float(np.median(laps))


def spread(laps_ms: list[float]) -> dict[str, float]:
    """Median and 99th percentile."""
    return {"median": float(np.median(laps_ms)), "p99": float(np.quantile(laps_ms, 0.99))}


def main() -> None:
    """Fly, print, write."""
    flights = dict(FLIGHTS)
    if (found := office()) is not None:
        flights["falcon_complex_office"] = found
    console = Console()
    results: dict[str, Any] = {}
    for name, overrides in flights.items():
        console.print(f"flying {name} ...")
        with multiprocessing.get_context("spawn").Pool(1) as pool:
            results[name] = pool.apply(fly, (overrides,))
    laps = {name: result["laps_ms"] for name, result in results.items()}
    esdf = {name: spread(laps[name]["esdf"]) for name in laps}
    summary = {
        "machine": {
            "processor": platform.processor() or platform.machine(),
            "cores": os.cpu_count(),
            "threads": 1,
            "python": platform.python_version(),
        },
        "reoptimise_ms": spread([lap for name in laps for lap in laps[name]["optimise"]]),
        "esdf_update_ms": esdf["dense"],
        "esdf_update_office_ms": esdf.get("falcon_complex_office"),
        "esdf_speedup_over_scipy": results["dense"]["fixed_ms"]["scipy"] / esdf["dense"]["median"],
        "fixed_ms": {name: result["fixed_ms"] for name, result in results.items()},
        "realtime_factor": {name: result["realtime"] for name, result in results.items()},
        "peak_memory_mib": {name: result["memory_mib"] for name, result in results.items()},
        "steps_ms": {name: {part: spread(times) for part, times in laps[name].items()} for name in laps},
    }
    table(console, summary)
    path = ROOT / "outputs" / "bench.json"
    path.write_text(json.dumps(summary, indent=2) + "\n")
    console.print(f"written: {path.relative_to(ROOT)}")


def table(console: Console, summary: dict[str, Any]) -> None:
    """Print every figure beside its target, and beside fixed work of the same run."""
    sheet = Table("figure", "median", "99 %", "ratio", "target", title="uavexp benchmark, one thread")
    fixed = summary["fixed_ms"]
    for name, figure, whose, target in (
        ("re-optimisation", summary["reoptimise_ms"], "dense", "3 / 10"),
        ("ESDF update, warehouse", summary["esdf_update_ms"], "dense", "2"),
        ("ESDF update, falcon_complex_office", summary["esdf_update_office_ms"], OFFICE.name, "2"),
    ):
        if figure is not None:
            sheet.add_row(f"{name}, ms", *spread_and_ratio(figure, name, fixed[whose]), target)
    sheet.add_row("ESDF speed-up over scipy, x", f"{summary['esdf_speedup_over_scipy']:.0f}", "", "", ">= 10")
    goals = {"dense": ">= 10", "voxel_block_grid": ">= 4", "dense_160x120": ">= 5"}
    for name, factor in summary["realtime_factor"].items():
        ratio = f"{1e3 / factor / fixed[name]['loop']:.0f} loops/s"
        sheet.add_row(f"real-time factor, {name}", f"{factor:.1f}", "", ratio, goals.get(name, ""))
    for name, memory in summary["peak_memory_mib"].items():
        sheet.add_row(f"peak memory, {name}, MiB", f"{memory:.0f}", "", "", "< 1024")
    for part, figure in summary["steps_ms"]["dense"].items():
        sheet.add_row(f"{part} (dense), ms", *spread_and_ratio(figure, part, fixed["dense"]), "")
    console.print(sheet)
    console.print(
        "ratio: median over scipy's transform, the rays of one image or the loop; a simulated second in loops"
    )
    console.print(f"{summary['machine']}")


def spread_and_ratio(figure: dict[str, float], name: str, fixed_ms: dict[str, float]) -> tuple[str, str, str]:
    """Median, 99 % and the ratio of the median to the fixed work most like it."""
    like = "scipy" if name.lower().startswith("esdf") else "rays" if name == "sense" else "loop"
    return (
        f"{figure['median']:.3f}",
        f"{figure['p99']:.3f}",
        f"{figure['median'] / fixed_ms[like]:.3f} {like}",
    )

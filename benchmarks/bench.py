"""`make bench`: times of the parts in real flights, real-time factors, memory; outputs/bench.json.

Each flight runs in a process of its own on one thread, after a short flight that loads the
compiled kernels. All figures of one run come from the same machine within minutes of each
other: read ratios, not single times.
"""

from __future__ import annotations

import json
import multiprocessing
import os
import platform
import resource
import time
from pathlib import Path
from typing import Any

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
    import uavexp
    from uavexp.config.build import build
    from uavexp.trial import fly_trial

    trial = uavexp.fly(strategy="mcr", seed=0, **overrides)
    parts = build(trial.config)
    begin = time.perf_counter()
    _, log = fly_trial(parts, 0)
    wall_s = time.perf_counter() - begin
    return {
        "outcome": str(log.outcome),
        "realtime": float(log.steps.time_s[-1]) / wall_s,
        "laps_ms": {name: (1e3 * laps).tolist() for name, laps in log.wall_s.items()},
        "memory_mib": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0,
        "scipy_edt_ms": scipy_edt_ms(parts.mapping.field.state),
    }


def scipy_edt_ms(state: np.ndarray) -> float:
    """Median time of scipy's exact transform of the whole map, both signs left out."""
    from scipy.ndimage import distance_transform_edt

    laps = []
    for _ in range(5):
        begin = time.perf_counter()
        distance_transform_edt(state != 2)
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
        "esdf_speedup_over_scipy": results["dense"]["scipy_edt_ms"] / esdf["dense"]["median"],
        "realtime_factor": {name: result["realtime"] for name, result in results.items()},
        "peak_memory_mib": {name: result["memory_mib"] for name, result in results.items()},
        "steps_ms": {name: {part: spread(times) for part, times in laps[name].items()} for name in laps},
    }
    table(console, summary)
    path = ROOT / "outputs" / "bench.json"
    path.write_text(json.dumps(summary, indent=2) + "\n")
    console.print(f"written: {path.relative_to(ROOT)}")


def table(console: Console, summary: dict[str, Any]) -> None:
    """Print every figure beside its target."""
    sheet = Table("figure", "median", "99 %", "target", title="uavexp benchmark, one thread")
    both = {
        "re-optimisation, ms": (summary["reoptimise_ms"], "3 / 10"),
        "ESDF update, warehouse, ms": (summary["esdf_update_ms"], "2"),
        "ESDF update, falcon_complex_office, ms": (summary["esdf_update_office_ms"], "2"),
    }
    for name, (figure, target) in both.items():
        if figure is not None:
            sheet.add_row(name, f"{figure['median']:.2f}", f"{figure['p99']:.2f}", target)
    sheet.add_row("ESDF speed-up over scipy, x", f"{summary['esdf_speedup_over_scipy']:.0f}", "", ">= 10")
    goals = {"dense": ">= 10", "voxel_block_grid": ">= 4", "dense_160x120": ">= 5"}
    for name, factor in summary["realtime_factor"].items():
        sheet.add_row(f"real-time factor, {name}", f"{factor:.1f}", "", goals.get(name, ""))
    for name, memory in summary["peak_memory_mib"].items():
        sheet.add_row(f"peak memory, {name}, MiB", f"{memory:.0f}", "", "< 1024")
    for part, figure in summary["steps_ms"]["dense"].items():
        sheet.add_row(f"{part} (dense), ms", f"{figure['median']:.3f}", f"{figure['p99']:.3f}", "")
    console.print(sheet)
    console.print(f"{summary['machine']}")

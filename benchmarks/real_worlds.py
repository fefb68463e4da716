"""Fly every start-target pair of every real building: `python -m benchmarks.real_worlds [strategy]`.

Reads ../shared/data/worlds and its manifest; prints one row per flight. Pairs whose
bottleneck clearance is below 0.35 m get `world.clearance_m` set just below it, so that the
task exists; what the flight makes of it is in the row.
"""

from __future__ import annotations

import json
import multiprocessing
import sys
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

DATA = Path(__file__).resolve().parents[2] / "shared" / "data"
COLUMNS = (
    "world", "pair", "straight m", "shortest m", "bottleneck m", "outcome", "contacts", "path m",
    "time s", "least clearance m", "replans", "map", "goal", "tracking m", "speed m/s", "reason",
)  # fmt: skip


def pairs() -> list[dict[str, Any]]:
    """Overrides and reference figures of every pair."""
    items = json.loads((DATA / "MANIFEST.json").read_text())["items"]
    found = []
    for item in items:
        if item["type"] != "world":
            continue
        for number, pair in enumerate(item["start_goal_pairs"]):
            bottleneck_m = float(pair["bottleneck_clearance_m"])
            overrides = {
                "world": "file",
                "world.path": str(DATA / item["folder"] / "mesh.ply"),
                "world.start_m": pair["start"],
                "world.target_m": pair["goal"],
                "world.flight_bounds_m": item["flight_bounds"],
            }
            if bottleneck_m < 0.35:
                overrides["world.clearance_m"] = round(bottleneck_m - 0.03, 2)
            found.append({"id": item["id"], "number": number, "pair": pair, "overrides": overrides})
    return found


def fly(job: tuple[dict[str, Any], str, str | None]) -> list[str]:
    """One flight, one row; with a folder, also its picture."""
    import uavexp
    from uavexp.errors import UavexpError

    entry, strategy, pictures = job
    pair = entry["pair"]
    head = [entry["id"], str(entry["number"]), f"{pair['straight_line_m']:.1f}"]
    bottleneck = f"{pair['bottleneck_clearance_m']:.2f}"
    try:
        trial = uavexp.fly(strategy=strategy, seed=0, **entry["overrides"])
    except UavexpError as error:
        return [*head, f"{pair['shortcut_path_m']:.1f}", bottleneck, "refused", *["-"] * 9, str(error)]
    m = trial.metrics
    if pictures is not None:
        from uavexp.report.picture import draw

        title = f"{entry['id']} pair {entry['number']}, {strategy}"
        draw(trial.world, trial.log, m, title, Path(pictures) / f"{entry['id']}_{entry['number']}.png")
    return [
        *head, f"{m['shortest_path_m']:.1f}", bottleneck, str(m["outcome"]), str(m["collision_count"]),
        f"{m['path_length_m']:.1f}", f"{m['completion_time_s']:.1f}", f"{m['min_clearance_m']:.2f}",
        str(m["replans"]), str(m["replans_map"]), str(m["replans_goal"]), f"{m['tracking_error_m']:.3f}",
        f"{m['mean_speed_mps']:.2f}", trial.log.reason,
    ]  # fmt: skip


def main() -> None:
    """Fly all, print rows as they come, then the table."""
    if not DATA.exists():
        sys.exit(f"{DATA} is absent: the real buildings are not part of this repository")
    strategy = sys.argv[1] if len(sys.argv) > 1 else "mcr"
    pictures = sys.argv[2] if len(sys.argv) > 2 else None
    table = Table(*COLUMNS, title=f"{strategy} in the real buildings, seed 0")
    jobs = [(entry, strategy, pictures) for entry in pairs()]
    with multiprocessing.get_context("spawn").Pool(2) as pool:
        for row in pool.imap(fly, jobs):
            print(" | ".join(row), flush=True)
            table.add_row(*row)
    Console(width=220).print(table)


if __name__ == "__main__":
    main()

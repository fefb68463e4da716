"""MCR, TBR and SSP on the same 40 generated worlds: `python -m benchmarks.closed_loop [SEEDS]`.

Runs the command line once per strategy and explorer, two at a time, into
outputs/closed_loop/<cell>, skipping cells that are already there, then prints the tables that
the README shows and writes all rows to outputs/closed_loop/trials.parquet.
Nothing here is tuned on these seeds (0:10); the defaults were chosen on seeds 100 to 107.
"""

from __future__ import annotations

import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pandas as pd

ROOT = Path(__file__).resolve().parents[1]
FOLDER = ROOT / "outputs" / "closed_loop"
FAMILIES = "world=warehouse,rooms,corridors,random_columns"
STRATEGIES: dict[str, list[str]] = {
    "MCR": ["strategy=mcr"],
    "MCR literal": ["strategy=mcr_literal"],
    "every map update": ["strategy=tbr", "trigger.interval_s=0.1"],
    **{f"TBR {s} s": ["strategy=tbr", f"trigger.interval_s={s}"] for s in ("0.5", "1", "2", "3", "5")},
    "SSP": ["strategy=ssp"],
}
# explorer=target_only is the second table: what SSP flies, and the cleanest comparison of triggers
CELLS = [("frontier", name) for name in STRATEGIES if name != "SSP"] + [
    ("target_only", name) for name in ("SSP", "MCR", "TBR 1 s")
]
COLUMNS = {
    "success %": lambda rows: f"{100 * rows.success.mean():.0f} {wilson(int(rows.success.sum()), len(rows))}",
    "contacts": lambda rows: f"{rows.collision_count.mean():.2f}",
    "clearance m": lambda rows: f"{rows.min_clearance_m.mean():.2f}",
    "replans": lambda rows: f"{rows.replans.mean():.1f}",
    "map / goal": lambda rows: f"{rows.replans_map.mean():.1f} / {rows.replans_goal.mean():.1f}",
    "path m": lambda rows: f"{rows.path_length_m.mean():.1f}",
    "path / shortest": lambda rows: f"{rows.path_length_m.mean() / rows.shortest_path_m.mean():.2f}",
    "time s": lambda rows: f"{rows.completion_time_s.mean():.1f}",
    "tracking m": lambda rows: f"{rows.tracking_error_m.mean():.3f}",
}


def wilson(successes: int, count: int) -> str:
    """95 % Wilson score interval of a rate, in percent."""
    z, rate = 1.96, successes / count
    centre = (rate + z * z / (2 * count)) / (1 + z * z / count)
    half = z * np.sqrt(rate * (1 - rate) / count + z * z / (4 * count * count)) / (1 + z * z / count)
    return f"[{100 * (centre - half):.0f}, {100 * (centre + half):.0f}]"


def fly(cell: tuple[str, str, str]) -> None:
    """One cell of all families and seeds, unless its table is there."""
    name, explorer, seeds = cell
    out = folder(name, explorer)
    if (out / "trials.parquet").exists():
        return
    overrides = [*STRATEGIES[name], f"explorer={explorer}", FAMILIES, f"seed={seeds}", f"out={out}"]
    done = subprocess.run(
        [sys.executable, "-m", "uavexp", *overrides], cwd=ROOT, capture_output=True, text=True, check=False
    )
    print(f"{name}, {explorer}: exit {done.returncode} {done.stderr.strip()[-200:]}", flush=True)


def folder(name: str, explorer: str) -> Path:
    """Where a cell's trials are."""
    explorer = "target_only" if name == "SSP" else explorer  # its one plan must lead to the target
    return FOLDER / f"{name.lower().replace(' ', '_')}-{explorer}"


def table(explorer: str) -> str:
    """Markdown, one row per strategy, n and interval in it."""
    lines = [f"| explorer={explorer} | n | {' | '.join(COLUMNS)} |", "|---" * (len(COLUMNS) + 2) + "|"]
    for name in STRATEGIES:
        if (explorer, name) not in CELLS and name != "SSP":
            continue
        rows = pd.read_parquet(folder(name, explorer) / "trials.parquet")
        figures = " | ".join(column(rows) for column in COLUMNS.values())
        lines.append(f"| {name} | {len(rows)} | {figures} |")
    return "\n".join(lines)


def main() -> None:
    """Fly what is missing, print both tables."""
    seeds = sys.argv[1] if len(sys.argv) > 1 else "0:10"
    cells = [(name, explorer, seeds) for explorer, name in CELLS]
    with ThreadPoolExecutor(2) as pool:
        list(pool.map(fly, cells))
    for explorer in ("frontier", "target_only"):
        print(table(explorer), end="\n\n")
    flown = [
        pd.read_parquet(folder(name, explorer) / "trials.parquet").assign(cell=name, explorer=explorer)
        for name, explorer, _ in cells
    ]
    pd.concat(flown, ignore_index=True).to_parquet(FOLDER / "trials.parquet", compression="zstd")


if __name__ == "__main__":
    main()

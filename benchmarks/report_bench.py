"""`python -m benchmarks.report_bench`: reports on 100,000 and 1,000,000 synthetic trials, seconds and memory.

5 arms x 10 scenes x 2000 or 20,000 seeds; a row in a thousand did not run to its end. The folder has
tables but no trial, so that figures that need logs are left out. A report is made in a process of its own.
"""

from __future__ import annotations

import json
import resource
import tempfile
import time
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa
from pyarrow import parquet
from rich.console import Console

from uavexp.config.experiment import list_experiments, read_experiment
from uavexp.report.make import make_report
from uavexp.store.study import STUDY
from uavexp.store.table import FIRST_OF_REPLANS, REPLANS, TABLE

ARMS = ("SSP", "TBR", "TBR frequent", "MCR", "MCR literal")
SCENES = tuple(f"scene {number}" for number in range(10))
TARGETS = {2000: "20 s", 20_000: "240 s"}  # seeds: of the whole report
PARAMETERS = 150  # columns `p_...` of a real table


def write_study(folder: Path, seeds: int) -> None:
    """A study folder with made-up measurements, as wide as a real one."""
    (folder / STUDY).write_text(
        json.dumps(
            {
                "name": "mcr/table1",
                "title": "Synthetic trials",
                "report": dict(read_experiment("mcr/table1", list_experiments()["mcr/table1"]).report),
                "axes": [["arm", ARMS], ["scene", SCENES]],
                "seeds": list(range(seeds)),
                "settings": {"primary": "MCR", "time_based": "TBR"},
                "cells": [],
            }
        )
    )
    _write(trials_table(seeds), folder / TABLE)
    _write(pd.DataFrame(columns=list(FIRST_OF_REPLANS), dtype=float), folder / REPLANS)


def _write(table: pd.DataFrame, path: Path) -> None:
    parquet.write_table(pa.Table.from_pandas(table, preserve_index=False), path, write_page_checksum=True)


def trials_table(seeds: int) -> pd.DataFrame:
    """Rows of made-up trials."""
    rng = np.random.default_rng(0)
    index = pd.MultiIndex.from_product([ARMS, SCENES, range(seeds)], names=["arm", "scene", "seed"])
    table = index.to_frame(index=False)
    n = len(table)
    hard = table["scene"].map(dict(zip(SCENES, rng.uniform(0.0, 0.3, len(SCENES)), strict=True)))
    table["success"] = rng.random(n) > hard
    table["outcome"], table["status"], table["world"] = "reached", "ok", "warehouse"
    table["strategy"] = table["arm"].str.split().str[0].str.lower()
    table["trial"] = [f"trial-{number}" for number in range(n)]
    table["collision_count"] = np.where(table["success"], 0, rng.poisson(2.0, n)).astype(float)
    table["replans"] = rng.poisson(8.0, n).astype(float)
    table["useful_replans"] = np.floor(table["replans"] * 0.7)
    for name in ("path_length_m", "shortest_path_m", "completion_time_s", "detour", "mean_speed_mps"):
        table[name] = 20.0 * rng.gamma(20.0, 0.05, n)
    for name in ("min_clearance_m", "min_clearance_esdf_m", "tracking_error_m", "tracking_error_max_m"):
        table[name] = rng.gamma(9.0, 0.05, n)
    for name in ("time_below_safety_s", "contact_time_s", "replans_per_m", "replans_per_s", "replans_map"):
        table[name] = rng.exponential(1.0, n)
    for name in ("acceleration_integral_m2ps3", "jerk_integral_m2ps5", "replans_near_change_share"):
        table[name] = rng.random(n)
    for name in ("clutter_density", "narrowest_gap_m", "straight_line_m"):
        table[name] = rng.random(n)
    table["p_planner_unknown"] = "optimistic"
    killed = rng.random(n) < 0.001
    measured = table.select_dtypes("number").columns.difference(["seed"])
    table.loc[killed, measured] = np.nan
    table.loc[killed, "success"] = False
    table.loc[killed, ["outcome", "status"]] = "error", "killed"
    parameters = pd.DataFrame({f"p_group_{number}": np.full(n, 0.5) for number in range(PARAMETERS)})
    return pd.concat([table, parameters], axis=1)


def peak_mib() -> float:
    """Peak memory of this process, MiB."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0


def measure(folder: Path, seeds: int) -> None:
    """Make the report and print what it took, by the clock and of the processor."""
    begin_s, used_s = time.perf_counter(), time.process_time()
    files = make_report(folder)
    wall_s, cpu_s = time.perf_counter() - begin_s, time.process_time() - used_s
    Console(highlight=False).print(
        f"{len(ARMS) * len(SCENES) * seeds:,} trials, {len(files)} files: {wall_s:.1f} s "
        f"({cpu_s:.1f} s of the processor; target {TARGETS[seeds]}), peak {peak_mib():.0f} MiB (target 2048)",
        soft_wrap=True,
    )


def main() -> None:
    """Write and report each study."""
    context = get_context("spawn")
    for seeds in TARGETS:
        with tempfile.TemporaryDirectory() as name:
            for work in (write_study, measure):
                process = context.Process(target=work, args=(Path(name), seeds))
                process.start()
                process.join()


if __name__ == "__main__":
    main()

"""Golden flights: short flights of every kind of part, each held to the digest of its log.

    make golden        flies them and keeps what they left in digests.json

A change of structure leaves every digest alone. A change of numbers makes them anew and names the
flights and the reason in CHANGELOG. A digest is over the log's arrays, byte for byte; that holds on one
lock file and one family of processors, so libraries that choose their kernels by the processor are held
to what every x86-64 with AVX2 has. Beside it stand a few figures of the flight, to tell what moved.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from collections.abc import Iterable
from pathlib import Path
from typing import Any

FLOWN = "UAVEXP_GOLDEN"  # variable: the file with what was flown before the tests were shared out
DIGESTS = Path(__file__).with_name("digests.json")
# libraries read these when they load
PROCESSOR = {
    "NPY_DISABLE_CPU_FEATURES": "X86_V4 AVX512_ICL AVX512_SPR",
    "OPENBLAS_CORETYPE": "Haswell",
}
COLUMNS = {"world": "random_columns", "world.size_m": [8.0, 6.0, 2.6], "world.density_per_m2": 0.15}
ROOMS = {"world": "rooms", "world.size_m": [8.0, 6.0, 2.6]}
FOUR_MOVERS = {"movers": "mixed", "movers.count": 4}
FLIGHTS: dict[str, dict[str, Any]] = {
    "mcr": {**ROOMS, "strategy": "mcr"},
    "mcr_literal": {**COLUMNS, "strategy": "mcr_literal", "unknown": "conservative"},
    "tbr": {**COLUMNS, "strategy": "tbr", "trigger.interval_s": 1.0, "safety": "brake"},
    "ssp": {**ROOMS, "strategy": "ssp", "stuck_s": 3.0},
    "frontier_covered": {**COLUMNS, "strategy": "frontier_covered", "mapping": "voxel_block_grid"},
    "collision_check": {
        **ROOMS, "strategy": "collision_check", "estimator": "drift", "vehicle": "point_mass",
    },
    "distance": {**COLUMNS, "strategy": "distance", "sensor": "lidar_rosette", "planner": "astar"},
    "expiry": {**COLUMNS, "strategy": "expiry", "mapping": "known", "planner": "rrtstar"},
    "risk": {**COLUMNS, **FOUR_MOVERS, "strategy": "risk", "planner": "improved_astar"},
    "people": {
        **COLUMNS, **FOUR_MOVERS, "strategy": "risk", "movers.reaction": "social",
        "detection.estimate": "imm",
    },
    "bspline_qp": {**COLUMNS, **FOUR_MOVERS, "planner": "bspline_qp", "detection": "noisy"},
    "bspline_mpc": {**COLUMNS, **FOUR_MOVERS, "strategy": "bspline_mpc", "detection": "truth"},
    "df_bitstar": {**ROOMS, "planner": "df_bitstar", "controller": "flatness"},
    "bitstar": {**COLUMNS, "planner": "bitstar", "world_seed": 5},
    "explore": {**ROOMS, "mission": "explore", "world.size_m": [6.0, 4.5, 2.6], "mission.time_base_s": 20.0},
    "frontier_3d": {
        "world": "multilevel", "strategy": "safe_3d", "world.storeys": 2,
        "world.size_m": [7.0, 6.06, 4.3], "world.racks": 1,
    },
    "inspect": {
        **ROOMS, "strategy": "inspect", "mission.blocks": 1, "world.size_m": [6.0, 4.6, 2.6],
        "mission.time_base_s": 10.0, "mission.time_per_viewpoint_s": 0.0, "mission.time_per_path_spm": 0.0,
    },
}  # fmt: skip


def fly(names: Iterable[str]) -> dict[str, dict[str, Any]]:
    """Fly some of `FLIGHTS`; the digest of each log, and what tells a person what moved."""
    import numpy as np

    import uavexp
    from uavexp.store.logs import arrays_digest, log_arrays

    found = {}
    for name in names:
        begin_s = time.perf_counter()
        trial = uavexp.fly(**{"seed": 1, **FLIGHTS[name]})
        found[name] = {
            "digest": arrays_digest(log_arrays(trial.log)),
            "outcome": str(trial.log.outcome),
            "end_s": round(float(trial.log.steps.time_s[-1]), 6),
            "plans": len(trial.log.replans),
            "path_m": round(float(trial.metrics["path_length_m"]), 6),
            "top_mps": round(float(np.linalg.norm(trial.log.steps.velocity_mps, axis=1).max()), 6),
        }
        print(f"{name:<16} {time.perf_counter() - begin_s:4.1f} s  {found[name]}", file=sys.stderr)
    return found


def fly_apart() -> dict[str, dict[str, Any]]:
    """Fly all of them, half in one process and half in another, held to one family of processors."""
    names = list(FLIGHTS)
    halves = [
        subprocess.Popen(
            [sys.executable, "-m", "tests.golden.flights", *half],
            env={**os.environ, **PROCESSOR}, stdout=subprocess.PIPE, cwd=Path(__file__).parents[2],
        )
        for half in (names[::2], names[1::2])
    ]  # fmt: skip
    found: dict[str, dict[str, Any]] = {}
    for half in halves:
        told, _ = half.communicate()
        if half.returncode:
            raise subprocess.CalledProcessError(half.returncode, half.args)
        found |= json.loads(told)
    return {name: found[name] for name in names}


if __name__ == "__main__":
    print(json.dumps(fly(sys.argv[1:])))

"""`python -m benchmarks.large_bench [EDGE_M ...]`: what a flight costs in halls of growing size.

Each hall is flown once, seed 0, in a process of its own after a short flight that loads the compiled
kernels. The real-time factor is simulated over user time; memory is that process's peak, the drawing of
the world included. What a step costs is told in ms and as a ratio to the smallest hall of the same run,
which does not depend on the machine: 1 means that the size of the building does not matter.
"""

from __future__ import annotations

import multiprocessing
import resource
import sys
from dataclasses import dataclass

import numpy as np
from rich.console import Console
from rich.table import Table

EDGES_M = (26.0, 50.0, 100.0, 200.0)
STEPS = ("sense", "integrate", "esdf", "explore", "trigger", "search", "optimise")
HALL = {"strategy": "mcr", "seed": 0, "world": "warehouse"}
# memory of a 200 m hall, were all of it seen; the default allows 100 m
MEMORY = {"mapping.max_memory_mb": 4000}


@dataclass(frozen=True, slots=True, kw_only=True)
class Cost:
    """What one flight cost."""

    edge_m: float
    voxels: int
    flown_s: float
    outcome: str
    realtime: float  # simulated over user time
    peak_mib: float
    step_ms: dict[str, tuple[float, float]]  # median and 99 %


def fly(edge_m: float) -> Cost:
    """Fly through a hall of this edge; run in a process of its own."""
    import uavexp
    from uavexp.config.build import build
    from uavexp.config.composition import Composer
    from uavexp.config.overrides import flatten
    from uavexp.seeding import Stream, generator
    from uavexp.trial import fly as fly_in

    uavexp.fly(**HALL, **{"world.size_m": [12.0, 8.0, 3.0]})
    values = {**HALL, **(MEMORY if edge_m > 100.0 else {}), "world.size_m": [edge_m, edge_m, 3.0]}
    settings = [setting for key, value in values.items() for setting in flatten(key, value)]
    parts = build(Composer().command(settings).cells[0].config)
    world = parts.mission.prepare(
        parts.world.generate(generator(0, Stream.WORLD)), generator(0, Stream.MISSION)
    )
    begin_s = resource.getrusage(resource.RUSAGE_SELF).ru_utime
    log = fly_in(parts, world, 0)
    usage = resource.getrusage(resource.RUSAGE_SELF)
    flown_s = float(log.steps.time_s[-1])
    return Cost(
        edge_m=edge_m,
        voxels=parts.mapping.field.state.size,
        flown_s=flown_s,
        outcome=str(log.outcome),
        realtime=flown_s / (usage.ru_utime - begin_s),
        peak_mib=usage.ru_maxrss / 1024.0,
        step_ms={
            name: (1e3 * float(np.median(laps)), 1e3 * float(np.quantile(laps, 0.99)))
            for name, laps in log.wall_s.items()
        },
    )


def table(costs: list[Cost]) -> Table:
    """A row for each figure, a column for each hall."""
    sheet = Table(
        "figure", *(f"{cost.edge_m:g} m" for cost in costs), title="halls of growing size, one thread"
    )
    sheet.add_row("map, million voxels", *(f"{cost.voxels / 1e6:.1f}" for cost in costs))
    sheet.add_row("flown, s", *(f"{cost.flown_s:.0f} ({cost.outcome})" for cost in costs))
    sheet.add_row("simulated over user time", *(f"{cost.realtime:.1f}" for cost in costs))
    sheet.add_row("peak memory, MiB", *(f"{cost.peak_mib:.0f}" for cost in costs))
    for step in STEPS:
        first_ms, _ = costs[0].step_ms[step]
        sheet.add_row(
            f"{step}, ms: median, 99 % (ratio)",
            *(f"{a:.2f}, {b:.1f} ({a / first_ms:.1f})" for a, b in (cost.step_ms[step] for cost in costs)),
        )
    return sheet


def main() -> None:
    """Fly in each hall and print."""
    console, costs = Console(), []
    for edge_m in map(float, sys.argv[1:] or EDGES_M):
        console.print(f"flying through {edge_m:g} m ...")
        with multiprocessing.get_context("spawn").Pool(1) as pool:
            costs.append(pool.apply(fly, (edge_m,)))
    console.print(table(costs))


if __name__ == "__main__":
    main()

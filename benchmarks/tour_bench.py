"""Time of an inspection plan as it grows: halls with 250, 500, 1000 and 2000 viewpoints.

Run from the repository root: python -m benchmarks.tour_bench. CPU seconds of one thread,
after a first small plan that loads the compiled kernels.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from uavexp.arrays import Float
from uavexp.field import DistanceField
from uavexp.inspection import tour_clusters as runs
from uavexp.inspection.inspection_plan import InspectionPlan, Settings, path_from, plan_inspection
from uavexp.inspection.reference_surface import reference_field, surface_of_mesh
from uavexp.inspection.travel import travel_matrix
from uavexp.inspection.view_angle import choose_yaw
from uavexp.inspection.viewpoints import Pattern
from uavexp.inspection.visibility import Camera
from uavexp.mission.more_stops import live_grid
from uavexp.types import World
from uavexp.world.rooms import Rooms

SIZES = {250: (22.0, 14.0), 500: (30.0, 20.0), 1000: (42.0, 28.0), 2000: (58.0, 40.0)}  # viewpoints: floor, m
LARGEST_OUTLIERS = (1, 2, 3, 5, 8)


def office(floor_m: tuple[float, float]) -> World:
    return Rooms(size_m=(*floor_m, 2.8), furniture_per_m2=0.05, table_share=0.2).generate(
        np.random.default_rng(100)
    )


def timed(call: Callable[[], Any]) -> tuple[Any, float]:
    begin = time.process_time()
    result = call()
    return result, time.process_time() - begin


def measure(
    floor_m: tuple[float, float], settings: Settings
) -> tuple[InspectionPlan, DistanceField, dict[str, float]]:
    world = office(floor_m)
    field, field_s = timed(lambda: reference_field(world.vertices_m, world.triangles, world.bounds_m))
    surface, surface_s = timed(
        lambda: surface_of_mesh(world.vertices_m, world.triangles, field, world.start_m)
    )
    plan, plan_s = timed(
        lambda: plan_inspection(surface, field, Camera(), world.start_m, world.flight_bounds_m, settings)
    )
    _, travel_s = timed(lambda: travel_matrix(plan.lattice, plan.viewpoints.position_m))
    _, tour_s = timed(lambda: path_from(plan.start_travel_m, plan.travel_m, 0))
    seconds = {
        "field_s": field_s,
        "surface_s": surface_s,
        "plan_s": plan_s,
        "of it travel_s": travel_s,
        "of it tour_s": tour_s,
        "total_s": field_s + surface_s + plan_s,
    }
    return plan, field, seconds


def choosing_ms(plan: InspectionPlan, field: DistanceField) -> Float:
    """Time of each choice of yaw (algorithm 2), with nothing seen yet: the most work."""
    grid, weight, views = live_grid(field), plan.surface.area_m2, plan.viewpoints
    calls = (
        partial(choose_yaw, grid, Camera(), plan.surface, weight, position_m, float(yaw_rad))
        for position_m, yaw_rad in zip(views.position_m, views.yaw_rad, strict=True)
    )
    return 1e3 * np.array([timed(call)[1] for call in calls])


def merging(plan: InspectionPlan) -> list[str]:
    """What merging and reordering cost and buy, without and with the limit on the lengthening."""
    segment, cost, start = plan.viewpoints.segment, plan.travel_m, plan.start_travel_m
    tour = runs.clusters_of(path_from(start, cost, 0), segment)
    lines = []
    for limit in (np.inf, Settings().max_lengthening):
        for largest in LARGEST_OUTLIERS:
            after = runs.reordered(
                runs.merge_outliers(tour, segment, cost, start, largest, limit), cost, start
            )
            longer = runs.visit_length_m(after, cost, start) / runs.visit_length_m(tour, cost, start) - 1.0
            lines.append(
                f"  limit {limit:4.2f} tau_max {largest}: length {100.0 * longer:+6.1f} %, "
                f"switches {runs.switches(tour)} -> {runs.switches(after)}"
            )
    return lines


def main() -> None:
    settings = Settings(pattern=Pattern(stand_off_m=1.5))
    choosing_ms(*measure((12.0, 10.0), settings)[:2])
    for wanted, floor in SIZES.items():
        plan, field, seconds = measure(floor, settings)
        print(f"wanted {wanted}: {len(plan.viewpoints)} viewpoints, {len(plan.segments)} segments, "
              f"coverage {plan.planned_coverage:.4f}")  # fmt: skip
        print("  " + ", ".join(f"{name} {value:.2f}" for name, value in seconds.items()), flush=True)
        median_ms, most_ms = np.quantile(choosing_ms(plan, field), (0.5, 0.99))
        print(f"  choice of yaw: median {median_ms:.1f} ms, 99 % {most_ms:.1f} ms", flush=True)
        if wanted == 500:
            print("\n".join(merging(plan)), flush=True)


if __name__ == "__main__":
    main()

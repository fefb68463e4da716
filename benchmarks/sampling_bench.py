"""DF-BIT* and its peers on fixed indoor scenes: time, length, collision checks.

    python -m benchmarks.sampling_bench

Scenes are worlds that no experiment reports, their best path about 24 m as in paper 4; the map is the
true one in voxels of 0.1 m. Per scene, over 10 seeds of the planner:
- geometric BIT*, ours against OMPL's: processor time and looks at the map until each has the path
  that OMPL ends with. OMPL calls back into Python for each edge; ours is compiled: the ratio is
  what a user gains, the looks at the map compare the algorithms;
- DF-BIT* with B-spline smoothing at its default budget: processor time of a plan, its length, and
  how much longer its searched path is than the best that any of the planners finds in 60 s.
Needs OMPL (pip install 'uavexp[peers]').
"""

from __future__ import annotations

import time
from typing import Any

import numpy as np

from tests.components import build
from uavexp.geometry import polyline_length_m
from uavexp.mapping.known import Known
from uavexp.planner.df_bitstar import DfBitstar
from uavexp.planner.find.free_space import free_space
from uavexp.planner.find.ompl_search import Query
from uavexp.planner.find.ompl_server import search_with_ompl
from uavexp.planner.find.tree import Tree
from uavexp.planner.shape.corridor_qp import CorridorQp
from uavexp.planner.shape.waypoint_spline import WaypointSpline
from uavexp.scene import Scene
from uavexp.seeding import Stream, generator
from uavexp.trajectory import evaluate
from uavexp.types import Goal, Limits, PlanRequest, PlanResult

LIMITS = Limits(
    max_speed_mps=5.0, max_acceleration_mps2=3.5, max_body_rate_radps=2.0, body_size_m=(0.32, 0.32, 0.12)
)
SCENES = (("rooms", 100), ("rooms", 101), ("warehouse", 103))
CLEARANCE_M, BAND_M, SEEDS, BEST_S, OMPL_ITERATIONS = 0.26, 0.3, 10, 60.0, 20_000


def request_in(world_name: str, seed: int) -> PlanRequest:
    """From start to target of a world on its true map."""
    world = build("world", world_name).generate(generator(seed, Stream.WORLD))
    known = Known()
    known.reset(world.bounds_m, Scene(world))
    known.mark_free(world.start_m, 0.6)
    known.update(0.0)
    return PlanRequest(
        time_s=0.0,
        position_m=world.start_m,
        velocity_mps=np.zeros(3),
        acceleration_mps2=np.zeros(3),
        goal=Goal(position_m=world.target_m, is_target=True, score=0.0),
        field=known.field,
        flight_bounds_m=world.flight_bounds_m,
    )


def timed(request: PlanRequest, seed: int, repeats: int = 1, **parameters: Any) -> tuple[float, PlanResult]:
    """Least processor time of a plan of DF-BIT*, ms, and the plan."""
    laps, shape = [], parameters.pop("shape", CorridorQp())
    for _ in range(repeats):
        planner = DfBitstar(find=Tree(**parameters), shape=shape)
        planner.reset(LIMITS, np.random.default_rng(seed))
        began_s = time.process_time()
        result = planner.plan(request)
        laps.append(time.process_time() - began_s)
    return 1e3 * min(laps), result


def geometric(request: PlanRequest) -> float:
    """Ours against OMPL's to the same length; returns the shortest path of either."""
    ends = np.stack([request.position_m, request.goal.position_m])
    space = free_space(request.field, ends, request.flight_bounds_m, CLEARANCE_M, BAND_M, False)
    plain = {"dynamics_filter": False, "shape": WaypointSpline()}
    rows, best = [], np.inf
    for seed in range(SEEDS):
        settings = {"setSamplesPerBatch": 100, "setRewireFactor": 1.1}
        theirs = search_with_ompl(Query("BITstar", settings, space, seed + 1, OMPL_ITERATIONS))
        length_m = theirs.history[-1, 1]
        _, whole = timed(request, seed, batches=200, **plain)
        reached = np.flatnonzero(whole.history[:, 1] <= length_m + 1e-9)
        best = min(best, length_m, whole.history[-1, 1])
        if not len(reached):
            print(f"  seed {seed}: OMPL's {length_m:.2f} m not reached in 200 batches")
            continue
        until = int(whole.history[reached[0], 0])
        lap_ms, ours = timed(request, seed, 3, batches=200, max_iterations=until, **plain)
        smoothing_ms = 1e3 * ours.wall_optimise_s
        rows.append(
            [1e3 * theirs.history[-1, 2], max(lap_ms - smoothing_ms, 0.01), theirs.history[-1, 3],
             ours.collision_checks, length_m]
        )  # fmt: skip
    table = np.array(rows)
    ratio = table[:, 0] / table[:, 1]
    print(
        f"  geometric BIT*, to {table[:, 4].mean():.2f} m: OMPL {np.median(table[:, 0]):.0f} ms and "
        f"{np.median(table[:, 2]):.0f} looks, ours {np.median(table[:, 1]):.1f} ms and "
        f"{np.median(table[:, 3]):.0f}; ratio median {np.median(ratio):.1f}, least {ratio.min():.1f} "
        f"({len(rows)} of {SEEDS} seeds)"
    )
    return float(best)


def best_of_any(request: PlanRequest, best_m: float) -> float:
    """The shortest path that any form finds in the time that is left of a minute of processor time."""
    began_s, seed = time.process_time(), 1000
    while time.process_time() - began_s < BEST_S:
        _, result = timed(request, seed, batches=400, dynamics_filter=False, shape=WaypointSpline())
        best_m, seed = min(best_m, float(result.history[-1, 1])), seed + 1
    return best_m


def main() -> None:
    """Print a few lines per scene."""
    timed(request_in(*SCENES[0]), 0)  # compiled
    for name, seed in SCENES:
        request = request_in(name, seed)
        print(f"{name}, seed {seed}", flush=True)
        best_m = best_of_any(request, geometric(request))
        laps, paths, plans = [], [], []
        for planner_seed in range(SEEDS):
            lap_ms, result = timed(request, planner_seed, 3)
            assert result.trajectory is not None
            span = np.linspace(result.trajectory.start_s, result.trajectory.end_s, 4000)
            laps.append(lap_ms)
            paths.append(polyline_length_m(result.path_m))
            plans.append(polyline_length_m(evaluate(result.trajectory, span)[0]))
        longer = 100.0 * (np.array(plans) / best_m - 1.0)
        print(
            f"  DF-BIT* and smoothing: median {np.median(laps):.0f} ms, most {max(laps):.0f}; path "
            f"{np.mean(paths):.2f} m, smoothed {np.mean(plans):.2f} m, the best of any in a minute "
            f"{best_m:.2f} m: smoothed {longer.mean():+.1f} % (worst {longer.max():+.1f})",
            flush=True,
        )


if __name__ == "__main__":
    main()

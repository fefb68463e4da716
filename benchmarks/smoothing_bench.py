"""Time of B-spline smoothing at paper 4's limits: the QP alone, and all of it, behind an A* search.

Process CPU time, the least of several repeats, against other load.
Run from the repository root: python -m benchmarks.smoothing_bench
"""

from __future__ import annotations

import gc
import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np

from uavexp.arrays import Float
from uavexp.check.fields import field_from, warehouse
from uavexp.check.requests import ask
from uavexp.geometry import polyline_length_m
from uavexp.planner.constraints import Constraints
from uavexp.planner.find.base import FoundPath
from uavexp.planner.find.free_space import FreeSpace, free_space
from uavexp.planner.find.grid import Grid
from uavexp.planner.movers.moving import MovingObstacles
from uavexp.planner.shape.cone_program import NO_CUTS, Problem, Solution, solve
from uavexp.planner.shape.corridor_qp import CorridorQp, Derivative
from uavexp.planner.shape.flight_corridor import make_corridor
from uavexp.planner.shape.shortcut import shortcut
from uavexp.planner.shape.timing import resample, smooth, time_profile
from uavexp.planner.spline.clamped import make_basis
from uavexp.trajectory import evaluate
from uavexp.types import Limits, PlanRequest, PlanStatus, Tracks

LIMITS = Limits(
    max_speed_mps=5.0, max_acceleration_mps2=3.5, max_body_rate_radps=2.0, body_size_m=(0.32, 0.32, 0.12)
)
CLEARANCE_M, REPEATS, CONTROL_POINTS = 0.26, 5, 30
KEPT = Constraints(
    limits=LIMITS, min_clearance_m=CLEARANCE_M, safe_clearance_m=0.75, z_band_m=0.3, known_only=False
)
NO_MOVERS = MovingObstacles(tracks=Tracks.none(), body_radius_m=0.0, margin_m=0.0, horizon_s=0.0)


def least_ms(work: Callable[[], object]) -> float:
    """Least process time of several calls, ms, after one that compiles."""
    work()
    spent = []
    for _ in range(REPEATS):
        began = time.process_time()
        work()
        spent.append(time.process_time() - began)
    return 1e3 * min(spent)


def tasks(seeds: int, count: int) -> list[tuple[PlanRequest, Float]]:
    """Requests of 15 to 28 m from rest to rest in cluttered halls, each with its A* path."""
    made: list[tuple[PlanRequest, Float]] = []
    for seed in range(seeds):
        grid = warehouse(seed)
        field, rng = field_from(grid), np.random.default_rng(seed)
        search = Grid()
        wanted = len(made) + count
        while len(made) < wanted:
            ends = rng.uniform([1.0, 1.0, 1.1], [25.0, 15.0, 1.6], (2, 3))
            if field.distance_m(ends).min() < 0.4:
                continue
            request = replace(ask(field, *ends), time_s=0.0)
            found = search.find(request, KEPT, rng)
            if found.status is PlanStatus.OK and 15.0 < polyline_length_m(found.path_m) < 28.0:
                made.append((request, found.path_m))
    return made


def _way(path_m: Float) -> FoundPath:
    return FoundPath(status=PlanStatus.OK, path_m=path_m)


def qp_alone(request: PlanRequest, path_m: Float) -> tuple[Solution, float]:
    """The paper's QP with 30 control points: all cuts of the limits included; ms."""
    space = _space(request)
    fine = resample(shortcut(resample(path_m, 0.1), space), 0.1)
    limits = (LIMITS.max_speed_mps, LIMITS.max_acceleration_mps2)
    times = time_profile(smooth(fine, 10), 0.0, 0.0, *limits)
    basis = make_basis(3, CONTROL_POINTS - 3, 2)
    points, guess = (
        np.stack([np.interp(np.linspace(0.0, times[-1], count), times, c) for c in fine.T], axis=1)
        for count in (CONTROL_POINTS - 2, CONTROL_POINTS)
    )
    corridor = make_corridor(request.field, points, request.flight_bounds_m, CLEARANCE_M, False)
    ends = np.zeros((2, 3, 3))
    ends[:, 0] = fine[[0, -1]]
    h = 1.05 * float(times[-1]) / len(basis.bezier)
    problem = Problem(basis, corridor, guess, ends[0], ends[1], *limits)
    answer = solve(problem, h, NO_CUTS, 12)
    for _ in range(20):  # the shortest duration, to 8 %, that keeps the limits
        if answer.control is not None:
            break
        h *= 1.08
        answer = solve(problem, h, NO_CUTS, 12)
    return answer, least_ms(lambda: solve(problem, h, NO_CUTS, 12))


def _space(request: PlanRequest) -> FreeSpace:
    ends = np.stack([request.position_m, request.goal.position_m])
    return free_space(request.field, ends, request.flight_bounds_m, CLEARANCE_M, np.inf, False)


def measure() -> dict[str, float]:
    """Times, ms, and qualities of the trajectories."""
    work = tasks(3, 8)
    figures: dict[str, float] = {}
    gc.disable()
    qps = [qp_alone(*task) for task in work]
    solved = [(answer, spent) for answer, spent in qps if answer.control is not None]
    figures["qp_30_points_solved"] = len(solved) / len(qps)
    figures["qp_30_points_rounds"] = float(np.mean([answer.solves for answer, _ in solved]))
    figures["qp_30_points_median_ms"] = float(np.median([spent for _, spent in solved]))
    figures["qp_30_points_per_round_median_ms"] = float(
        np.median([spent / answer.solves for answer, spent in solved])
    )
    for kind in Derivative:
        shaper, spent, stretch, over, ok = CorridorQp(derivative=kind), [], [], 0.0, 0
        least = np.inf
        for request, path in work:
            result = shaper.shape(request, _way(path), KEPT, NO_MOVERS)
            spent.append(least_ms(partial(shaper.shape, request, _way(path), KEPT, NO_MOVERS)))
            if result.trajectory is None:
                continue
            ok += 1
            times = np.append(np.arange(0.0, result.trajectory.end_s, 1e-3), result.trajectory.end_s)
            p, v, a = evaluate(result.trajectory, times)
            straight = polyline_length_m(shortcut(resample(path, 0.1), _space(request)))
            stretch.append(polyline_length_m(p) / straight)
            speed = np.linalg.norm(v, axis=1).max() / LIMITS.max_speed_mps
            strength = np.linalg.norm(a, axis=1).max() / LIMITS.max_acceleration_mps2
            over, least = max(over, speed, strength), min(least, request.field.distance_m(p).min())
        figures |= {
            f"{kind}_planned_share": ok / len(work),
            f"{kind}_median_ms": float(np.median(spent)),
            f"{kind}_most_ms": float(np.max(spent)),
            f"{kind}_length_over_shortcut_median": float(np.median(stretch)),
            f"{kind}_length_over_shortcut_most": float(np.max(stretch)),
            f"{kind}_most_share_of_a_limit": float(over),
            f"{kind}_least_clearance_m": float(least),
        }
    gc.enable()
    return figures


if __name__ == "__main__":
    for name, value in measure().items():
        print(f"{name:42s} {value:8.3f}")

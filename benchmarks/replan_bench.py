"""`python -m benchmarks.replan_bench [REV]`: whole replans of `min_acc` on 300 fixed queries, twice.

Three worlds of 0.1 m voxels (a hall of shelves, a forest, rooms with doors), 100 pairs of places each, 7 to
8 m apart, once from rest and once at 1.5 m/s within 45° of the goal; 2 m/s, 3 m/s², rest at the goal, one
thread. Each curve is judged here, on a 10 ms grid to its end. With REV, that revision answers the same
queries by turns, and its figures stand beside; ratios are this checkout's over REV's.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import IO, cast

import numpy as np

from benchmarks.against import ROOT, Checkout, worktree
from uavexp.arrays import Bool, Float
from uavexp.check.fields import box, empty, field_from, warehouse
from uavexp.field import DistanceField
from uavexp.trajectory import Trajectory, derivative, evaluate

SIZE_M, PAIRS, SPEED_MPS, LIMITS, GRID_S = (26.0, 16.0, 3.0), 100, 1.5, (2.0, 3.0), 0.01
# answers a query's least user time of three, ms, and its trajectory; written for either layout of the package
PLANNER = """
import gc, json, sys, time
import numpy as np
from uavexp.planner.min_acc import MinAcc
from uavexp.types import Goal, Limits, PlanRequest
try:
    from uavexp.field import DistanceField
except ImportError:
    from uavexp.mapping.base import DistanceField
stored = np.load(sys.argv[1])
def field_of(distance):
    state = np.where(distance < 0.0, 2, 1).astype(np.uint8)
    size = dict(voxel_size_m=0.1, max_distance_m=2.5)
    return DistanceField(origin_m=np.zeros(3), distance=distance, state=state, **size)
fields = [field_of(distance) for distance in stored["distance"]]
bounds = np.stack([np.zeros(3), 0.1 * np.array(fields[0].distance.shape)])
speed, acceleration = stored["limits"]
planner = MinAcc()
planner.reset(Limits(max_speed_mps=speed, max_acceleration_mps2=acceleration, max_body_rate_radps=2.0,
                     body_size_m=(0.32, 0.32, 0.12)), np.random.default_rng(0))
def plan(world, start, goal, velocity):
    return planner.plan(PlanRequest(
        time_s=0.0, position_m=np.array(start), velocity_mps=np.array(velocity),
        acceleration_mps2=np.zeros(3), goal=Goal(position_m=np.array(goal), is_target=True, score=0.0),
        field=fields[world], flight_bounds_m=bounds))
gc.disable()
for line in sys.stdin:
    query, took_s = json.loads(line), []
    plan(*query)
    for _ in range(3):
        began_s = time.process_time()
        found = plan(*query).trajectory
        took_s.append(time.process_time() - began_s)
    curve = found and [found.breaks_s.tolist(), found.coefficients.tolist()]
    print(json.dumps([1e3 * min(took_s), curve]), flush=True)
"""
Query = tuple[int, list[float], list[float], list[float]]  # world, start m, goal m, velocity m/s
Answer = tuple[float, Trajectory | None]  # user time ms


def forest(seed: int) -> Bool:
    """100 round trunks, 0.2 to 0.8 m thick."""
    rng, grid = np.random.default_rng(seed), empty(SIZE_M)
    x, y = np.meshgrid(*(0.1 * np.arange(0.5, count) for count in grid.shape[:2]), indexing="ij")
    for _ in range(100):
        at, radius = rng.uniform((0.0, 0.0), SIZE_M[:2]), rng.uniform(0.1, 0.4)
        grid[np.hypot(x - at[0], y - at[1]) < radius] = True
    return grid


def rooms(seed: int) -> Bool:
    """Five by three rooms, a door 1 m wide in each wall between two, and 20 boxes."""
    rng, grid, (long, wide, high) = np.random.default_rng(seed), empty(SIZE_M), SIZE_M
    columns, rows = np.arange(5.2, long - 1.0, 5.2), (5.3, 10.6)
    for x in columns:
        box(grid, (x, 0.0, 0.0), (x + 0.2, wide, high))
    for y in rows:
        box(grid, (0.0, y, 0.0), (long, y + 0.2, high))
    for x in columns:
        for y in (0.3, 5.6, 10.9):
            door = round(10.0 * (y + rng.uniform(0.5, 3.5)))
            grid[round(10.0 * x) : round(10.0 * x) + 2, door : door + 10, :21] = False
    for y in rows:
        for x in np.arange(0.3, long - 1.0, 5.2):
            door = round(10.0 * (x + rng.uniform(0.5, 3.5)))
            grid[door : door + 10, round(10.0 * y) : round(10.0 * y) + 2, :21] = False
    for _ in range(20):
        (x, y), side = rng.uniform((1.0, 1.0), (long - 1.0, wide - 1.0)), rng.uniform(0.3, 0.8)
        box(grid, (x, y, 0.0), (x + side, y + side, rng.choice([0.8, 2.0])))
    return grid


def pairs(world: int, field: DistanceField, rng: np.random.Generator) -> Iterator[Query]:
    """Places with room around them, and a velocity with room before it."""
    low, high = (1.0, 1.0, 1.0), (SIZE_M[0] - 1.0, SIZE_M[1] - 1.0, 1.5)
    made = 0
    while made < PAIRS:
        start, towards, away = rng.uniform(low, high), rng.uniform(0.0, 2.0 * np.pi), rng.uniform(7.0, 8.0)
        goal = start + away * np.array([np.cos(towards), np.sin(towards), 0.0])
        goal[2] = rng.uniform(low[2], high[2])
        heading = towards + rng.uniform(-0.25 * np.pi, 0.25 * np.pi)
        ahead = np.array([np.cos(heading), np.sin(heading), 0.0])
        inside = (goal >= low).all() and (goal <= high).all()
        if not inside or field.distance_m(np.stack([start, goal])).min() < 0.4:
            continue
        if field.distance_m(start + np.arange(0.0, 1.0, 0.05)[:, None] * ahead).min() >= 0.35:
            made += 1
            yield world, start.tolist(), goal.tolist(), (SPEED_MPS * ahead).tolist()


@contextlib.contextmanager
def planner(checkout: Checkout, stored: Path) -> Iterator[Callable[[Query], Answer]]:
    """A process that answers queries."""
    with checkout.python("-c", PLANNER, str(stored)) as process:
        asked, answers = cast(IO[str], process.stdin), cast(IO[str], process.stdout)

        def answer(query: Query) -> Answer:
            print(json.dumps(query), file=asked, flush=True)
            took_ms, curve = json.loads(answers.readline())
            if curve is None:
                return took_ms, None
            breaks, coefficients = (np.array(part) for part in curve)
            return took_ms, Trajectory(breaks_s=breaks, coefficients=coefficients, at_rest=True)

        yield answer
        asked.close()


def judged(fields: list[DistanceField], queries: list[Query], answers: list[Answer]) -> dict[str, float]:
    """Times, and the qualities of the curves that were found."""
    rows = []
    for (world, *_), (_, curve) in zip(queries, answers, strict=True):
        if curve is None:
            continue
        times_s = np.append(np.arange(0.0, curve.end_s, GRID_S), curve.end_s)
        place, velocity, acceleration = evaluate(curve, times_s)
        jerk: Float = derivative(curve, times_s, 3)
        rows.append(
            [
                curve.duration_s,
                GRID_S * (jerk**2).sum(),
                fields[world].distance_m(place).min(),
                np.linalg.norm(velocity, axis=1).max() / LIMITS[0],
                np.linalg.norm(acceleration, axis=1).max() / LIMITS[1],
            ]
        )
    took_ms, found = np.array([took for took, _ in answers]), np.array(rows)
    return {
        "median ms": float(np.median(took_ms)),
        "99 % ms": float(np.percentile(took_ms, 99)),
        "without a curve": float(len(answers) - len(rows)),
        "in collision (no room for the body's half height)": float((found[:, 2] < 0.06).sum()),
        "mean duration s": float(found[:, 0].mean()),
        "mean ∫ jerk² m²/s⁵": float(found[:, 1].mean()),
        "mean least clearance m": float(found[:, 2].mean()),
        "least clearance m": float(found[:, 2].min()),
        "greatest share of the limits": float(found[:, 3:].max()),
    }


def main() -> None:
    """Print the figures."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.replan_bench")
    parser.add_argument("revision", nargs="?", help="compared with")
    parser.add_argument("--kept", type=Path, help="folder of its worktree, made if absent, that stays")
    chosen = parser.parse_args()
    versus = f"; {chosen.revision}; ratio" if chosen.revision else ""
    rng = np.random.default_rng(15)
    fields = [field_from(make(15)) for make in (warehouse, forest, rooms)]
    moving = [query for world, field in enumerate(fields) for query in pairs(world, field, rng)]
    resting: list[Query] = [(world, start, goal, [0.0, 0.0, 0.0]) for world, start, goal, _ in moving]
    with contextlib.ExitStack() as stack:
        stored = Path(stack.enter_context(tempfile.TemporaryDirectory())) / "queries.npz"
        np.savez(stored, distance=np.stack([field.distance for field in fields]), limits=np.array(LIMITS))
        checkouts = [Checkout(ROOT)]
        if chosen.revision:
            checkouts.append(stack.enter_context(worktree(chosen.revision, chosen.kept)))
        planners = [stack.enter_context(planner(checkout, stored)) for checkout in checkouts]
        for name, queries in (("from rest", resting), (f"at {SPEED_MPS:g} m/s", moving)):
            answers = [[answer(query) for answer in planners] for query in queries]
            figures = [judged(fields, queries, list(of)) for of in zip(*answers, strict=True)]
            print(f"{len(queries)} replans {name}{versus}")
            for key, value in figures[0].items():
                other = [figure[key] for figure in figures[1:]]
                beside = "".join(f" {was:9.3f} {value / was if was else np.nan:9.2f}" for was in other)
                print(f"  {key:50s} {value:9.3f}{beside}", flush=True)


if __name__ == "__main__":
    main()

"""`python -m benchmarks.mpc_bench`: the dynamic planner of `bspline_mpc` among 8 predicted movers at 10 Hz.

No flight: the vehicle is where its last plan says, and the movers keep their velocity, turning
back at the hall's walls, where their predictions are wrong for once. Times are of the process
(CPU), so that other load on the machine tells less; the first requests, which load kernels, do
not count.
"""

from __future__ import annotations

import gc
import time
from dataclasses import dataclass, field

import numpy as np

from uavexp.arrays import Float
from uavexp.check.fields import bounds, empty, field_from
from uavexp.field import DistanceField
from uavexp.planner.bspline_mpc import BsplineMpc
from uavexp.planner.movers.moving import MovingObstacles
from uavexp.trajectory import evaluate
from uavexp.types import Goal, Limits, PlanRequest, Tracks

LIMITS = Limits(
    max_speed_mps=2.5, max_acceleration_mps2=2.5, max_body_rate_radps=2.0, body_size_m=(0.32, 0.32, 0.12)
)
HALL_M = (16.0, 8.0, 3.0)
MOVERS, SCENES, PERIOD_S, LONGEST_S = 8, 20, 0.1, 30.0
HALF_SIZE_M = np.array([0.25, 0.25, 0.9])  # a person
SPREAD_M, SPREAD_MPS = 0.05, 0.15  # standard deviations of position and velocity that the planner is told


@dataclass(slots=True)
class Crossing:
    """One vehicle that crosses a hall among movers, and what came of it."""

    plan_ms: list[float] = field(default_factory=list)  # whole requests
    follow_ms: list[float] = field(default_factory=list)  # those that only followed the spline
    room_m: float = np.inf  # least clearance of the body's circle from any mover
    arrived: bool = False
    failed: int = 0


def hall() -> tuple[DistanceField, Float]:
    """A hall with two rows of pillars, and its bounds."""
    grid = empty(HALL_M)
    grid[:, :, 0], grid[:, :, -1] = True, True
    for x in range(30, 140, 30):
        for y in (25, 50):
            grid[x : x + 4, y : y + 4] = True
    return field_from(grid), bounds(grid)


def movers(rng: np.random.Generator) -> tuple[Float, Float]:
    """Places (B, 3) away from the start, and level velocities (B, 3)."""
    place = rng.uniform([4.0, 1.0, 0.9], [14.0, 7.0, 0.9], (MOVERS, 3))
    angle, speed = rng.uniform(0.0, 2.0 * np.pi, MOVERS), rng.uniform(0.4, 1.5, MOVERS)
    return place, np.stack([speed * np.cos(angle), speed * np.sin(angle), 0.0 * speed], axis=1)


def tracks_of(time_s: float, place: Float, velocity: Float) -> Tracks:
    """What a tracker would say of the movers."""
    variance = np.repeat([SPREAD_M**2, SPREAD_MPS**2], 3)
    return Tracks(
        time_s=time_s,
        identity=np.arange(len(place)),
        position_m=place,
        velocity_mps=velocity,
        covariance=np.tile(np.diag(variance), (len(place), 1, 1)),
        half_size_m=np.tile(HALF_SIZE_M, (len(place), 1)),
    )


def cross(planner: BsplineMpc, seed: int) -> Crossing:
    """Cross the hall once, asking for a plan every 0.1 s."""
    rng, result = np.random.default_rng(seed), Crossing()
    field_, box = hall()
    planner.reset(LIMITS, rng)
    place, velocity = movers(rng)
    state = np.zeros((3, 3))
    state[0] = [1.0, 4.0, 1.3]
    goal = Goal(position_m=np.array([15.0, 4.0, 1.3]), is_target=True, score=0.0)
    steps = np.arange(0.0, PERIOD_S, 0.02)
    for tick in range(round(LONGEST_S / PERIOD_S)):
        now_s = tick * PERIOD_S
        tracks = tracks_of(now_s, place, velocity)
        request = PlanRequest(
            time_s=now_s,
            position_m=state[0],
            velocity_mps=state[1],
            acceleration_mps2=state[2],
            goal=goal,
            field=field_,
            flight_bounds_m=box,
            tracks=tracks,
        )
        began = time.process_time()
        answer = planner.plan(request)
        spent_ms = 1e3 * (time.process_time() - began)
        result.plan_ms.append(spent_ms)
        if answer.trajectory is None:
            result.failed += 1
            break
        if answer.expansions == 0:
            result.follow_ms.append(spent_ms)
        flown = evaluate(answer.trajectory, now_s + steps)[0]
        near = MovingObstacles(
            tracks=tracks_of(now_s, place, velocity),
            body_radius_m=LIMITS.body_radius_m,
            margin_m=0.0,
            horizon_s=1.0,
        )
        exact = near.clearance_m(flown, now_s + steps)
        result.room_m = min(result.room_m, float(exact.min()) + SPREAD_M)
        state = np.concatenate(evaluate(answer.trajectory, np.array([now_s + PERIOD_S])))
        place = place + PERIOD_S * velocity
        leaving = ((place < 0.5) & (velocity < 0.0)) | ((place > np.array(HALL_M) - 0.5) & (velocity > 0.0))
        velocity = np.where(leaving, -velocity, velocity)
        if np.linalg.norm(state[0] - goal.position_m) < 0.3:
            result.arrived = True
            break
    return result


def measure() -> dict[str, float]:
    """Milliseconds of CPU, and what came of the crossings."""
    planner = BsplineMpc()
    cross(planner, SCENES)
    results, slackened, braked = [], 0, 0
    gc.disable()
    for seed in range(SCENES):
        results.append(cross(planner, seed))
        slackened, braked = slackened + planner.slackened, braked + planner.braked
    gc.enable()
    follow = np.concatenate([r.follow_ms for r in results])
    plan = np.concatenate([r.plan_ms for r in results])
    return {
        "follow_median_ms": float(np.median(follow)),
        "follow_p99_ms": float(np.percentile(follow, 99)),
        "plan_median_ms": float(np.median(plan)),
        "plan_p99_ms": float(np.percentile(plan, 99)),
        "requests": float(len(plan)),
        "slackened_share": slackened / len(plan),
        "braked_share": braked / len(plan),
        "arrived_share": sum(r.arrived for r in results) / SCENES,
        "failed": float(sum(r.failed for r in results)),
        "touched_share": sum(r.room_m < 0.0 for r in results) / SCENES,
        "least_room_m": min(r.room_m for r in results),
    }


if __name__ == "__main__":
    for name, value in measure().items():
        print(f"{name:24s} {value:8.3f}")

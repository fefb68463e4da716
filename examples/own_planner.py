"""A planner of one's own: straight at the goal, or a reason why not. It finds no way around."""

import numpy as np

import uavexp
from uavexp.trajectory import Trajectory, evaluate, sample_times
from uavexp.types import PlanResult, PlanStatus


class Straight:
    """Joins the present state to the goal by one quintic, the fastest that keeps the limits."""

    def reset(self, limits, rng):
        """Begin a trial."""
        self.limits = limits

    def plan(self, request):
        """A trajectory, or why there is none: that is a status, no exception."""
        start = np.stack([request.position_m, request.velocity_mps, 0.5 * request.acceleration_mps2])
        for duration_s in 0.5 * 1.1 ** np.arange(60):
            power, t = np.arange(6), duration_s
            rows = np.stack([t**power, power * t ** np.maximum(power - 1, 0),
                             power * (power - 1) * t ** np.maximum(power - 2, 0)])  # fmt: skip
            end = np.stack([request.goal.position_m, np.zeros(3), np.zeros(3)])
            upper = np.linalg.solve(rows[:, 3:], end - rows[:, :3] @ start)
            plan = Trajectory(breaks_s=request.time_s + np.array([0.0, t]),
                              coefficients=np.concatenate([start, upper])[None], at_rest=True)  # fmt: skip
            at_m, speed, push = evaluate(plan, sample_times(plan, plan.start_s, 0.02))
            fast = np.linalg.norm(speed, axis=1).max() > self.limits.max_speed_mps
            if not fast and np.linalg.norm(push, axis=1).max() <= self.limits.max_acceleration_mps2:
                if request.field.distance_m(at_m).min() < 0.35:
                    return PlanResult(status=PlanStatus.NOT_CLEAR, reason="an obstacle is in the way")
                return PlanResult(status=PlanStatus.OK, trajectory=plan)
        return PlanResult(status=PlanStatus.LIMITS, reason="no duration keeps the limits")


print(uavexp.fly(planner=Straight(), world="random_columns", vehicle="point_mass", seed=103,
                 **{"world.size_m": [9, 6, 3]}))  # fmt: skip

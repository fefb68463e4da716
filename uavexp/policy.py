"""What a trigger sees as a fixed vector, and a trigger that asks a function of it, e.g. a learned one."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from uavexp.arrays import Float, Float32
from uavexp.field import DistanceField
from uavexp.trajectory import Trajectory, evaluate, sample_times
from uavexp.types import Decision, Limits, Observation

CAUSE = "policy"
AHEAD_S = (0.0, 0.25, 0.5, 0.75, 1.0, 1.5, 2.0, 3.0)  # places on the flown trajectory that are looked at
_SAMPLE_S = 0.05  # as the mcr trigger samples a plan
_FAR_M = 100.0

Policy = Callable[[Float32], bool]  # the vector in, whether to replan


@dataclass(frozen=True, slots=True)
class Feature:
    """One number of the vector; it is clipped to its bounds."""

    name: str
    low: float
    high: float
    what: str


FEATURES = (
    Feature("speed_mps", 0.0, 20.0, "of the vehicle, as believed"),
    Feature("tracking_error_m", 0.0, _FAR_M, "distance of the vehicle from its reference"),
    Feature("plan_age_s", -1.0, 1000.0, "since the flown plan took effect; negative: it is still to"),
    Feature("plan_left_s", 0.0, 1000.0, "until the flown plan ends"),
    Feature("goal_m", 0.0, _FAR_M, "distance of the flown plan's goal; 0: it has none, it is a stop"),
    Feature("goal_drift_m", 0.0, _FAR_M, "distance of the explorer's choice now from that goal"),
    Feature("target_m", 0.0, _FAR_M, "distance of the mission's target; 0: there is none"),
    Feature("changed_voxels_log10", 0.0, 9.0, "log10(1 + voxels that the latest map update changed)"),
    Feature("mover_m", 0.0, _FAR_M, "distance of the nearest believed mover; the bound: there is none"),
    *(
        Feature(f"clearance_{at_s:g}s_m", -_FAR_M, _FAR_M, "mapped, where the plan is then")
        for at_s in AHEAD_S
    ),
    *(Feature(f"lost_{at_s:g}s_m", -_FAR_M, _FAR_M, "of it since the plan was made") for at_s in AHEAD_S),
    *(Feature(f"seen_{at_s:g}s", 0.0, 1.0, "1: that place was ever seen") for at_s in AHEAD_S),
)
LOW = np.array([feature.low for feature in FEATURES], dtype=np.float32)
HIGH = np.array([feature.high for feature in FEATURES], dtype=np.float32)


@dataclass(frozen=True, slots=True, kw_only=True)
class Made:
    """The clearance along a plan on the map it was made on."""

    start_s: float
    after_s: Float  # (N,) since the start
    clearance_m: Float  # (N,)

    @classmethod
    def of(cls, plan: Trajectory, field: DistanceField) -> Made:
        """Sample a new plan."""
        times_s = sample_times(plan, plan.start_s, _SAMPLE_S)
        clearance_m = field.distance_m(evaluate(plan, times_s)[0])
        return cls(start_s=plan.start_s, after_s=times_s - plan.start_s, clearance_m=clearance_m)


def vector_of(seen: Observation, flown: Trajectory, made: Made) -> Float32:
    """The numbers of `FEATURES` (F,), within their bounds.

    Args:
        seen: what a trigger sees.
        flown: its trajectory, which there is.
        made: of the latest plan; until that takes effect, nothing counts as lost.
    """
    here_m, times_s = seen.state.position_m, seen.time_s + np.array(AHEAD_S)
    ahead_m = evaluate(flown, times_s)[0]
    clearance_m = seen.field.distance_m(ahead_m)
    then_m = np.interp(times_s - flown.start_s, made.after_s, made.clearance_m)
    lost_m = then_m - clearance_m if seen.time_s >= made.start_s else np.zeros_like(then_m)
    goal_m = None if seen.goal is None else seen.goal.position_m
    best_m = None if seen.best_goal is None else seen.best_goal.position_m
    movers_m = np.linalg.norm(seen.tracks.position_m - here_m, axis=1)
    values = [
        np.linalg.norm(seen.state.velocity_mps),
        _apart_m(seen.reference.position_m, here_m),
        seen.time_s - flown.start_s,
        flown.end_s - seen.time_s,
        _apart_m(goal_m, here_m),
        _apart_m(goal_m, best_m),
        _apart_m(seen.target_m, here_m),
        np.log10(1 + len(seen.update.voxel)),
        movers_m.min(initial=_FAR_M),
        *clearance_m,
        *lost_m,
        *seen.field.observed(ahead_m),
    ]
    return np.clip(np.array(values, dtype=np.float32), LOW, HIGH)


def _apart_m(one_m: Float | None, other_m: Float | None) -> float:
    return 0.0 if one_m is None or other_m is None else float(np.linalg.norm(one_m - other_m))


class PolicyTrigger:
    """Replans when a function of `vector_of` says so: `uavexp.fly(trigger=PolicyTrigger(policy))`."""

    def __init__(self, policy: Policy) -> None:
        self.policy = policy
        self.plans = 0  # that were made
        self.time_s = 0.0  # of the latest question
        self._made: Made | None = None

    def reset(self, limits: Limits) -> None:
        """Begin a trial."""
        self.plans, self.time_s, self._made = 0, 0.0, None

    def planned(self, trajectory: Trajectory, field: DistanceField) -> None:
        """Keep the clearance of a new plan."""
        self._made = Made.of(trajectory, field)
        self.plans += 1

    def decide(self, observation: Observation) -> Decision:
        """Ask the policy once there is a plan."""
        if observation.trajectory is None or self._made is None:
            return Decision(replan=False)
        self.time_s = observation.time_s
        replan = bool(self.policy(vector_of(observation, observation.trajectory, self._made)))
        return Decision(replan=replan, cause=CAUSE if replan else "")

"""Fly only what can be stopped in: the committed part of a plan, after FASTER and SUPER.

A place is verified where every voxel of the body's upright cylinder was seen and the mapped distance
keeps the body's radius and `margin_m`; where it keeps `narrow_clearance_m` only, it is flown at
`narrow_speed_mps` at most. What is flown of a plan is its way at a pace (`uavexp.pace`) that comes to rest
before the first place that is not verified. After every ESDF update the pace is made anew from the
present one; where the way is seen for a stopping distance and more, that is the plan as planned,
else the speed falls along the way long before its end, at `comfort_share` of the acceleration limit.

**Guarantee.** The reference never enters a place that was not verified, but for leaving one that was
not verified to begin with.

**Proof.** (1) At every instant what is flown is a way with a pace that ends at rest, all of it
verified when the pace was made: so it is when the vehicle stands at the start. (2) An update
replaces the pace only by one that ends at rest within what is verified now, or, where no
deceleration reaches that any more, by the shortest stop along the same way, which lies within the
stop that was verified before. (3) A new plan replaces the way only if from its first state, which
is the reference's, a pace along it ends at rest within what is verified; else it has failed, and
the old way goes on to be stopped on. (4) Nothing else moves the reference, and when neither update
nor plan comes, time runs to the end of the pace, where the vehicle stands. (5) Hence by induction
over updates and plans the reference is in a verified place at all times, and the body is clear of
all that is mapped as long as the assumptions hold.

**Assumptions.** What was seen as free is free and stays so: the map is wrong by less than `margin_m`
and what is kept by the planner beyond it (a plate thinner than half a voxel, seen edge-on, may be
missing from `mapping=dense`; `dense_thin` has it), and nothing moves (movers are the planner's and the
trigger's to avoid); the vehicle is on its reference but for an error below the same margin and what is
left between the body and its turning circle. At 2.5 m/s half of 1,120 flights never came off by more
than 0.05 m, 99 in 100 by no more than 0.14 m, the worst by 0.33 m; at 5 m/s and 4 m/s², where a new
plan may turn at once as sharply as the limit allows, the worst of 56 by 0.45 m, and it touched (column
`tracking_error_max_m`). It is counted, not proved: the pace falls to 0 as the error, or what the
present difference of velocity makes of it, comes to the room beside the way, and to `stop_error_m`
anywhere; and no pace turns the acceleration faster than the vehicle follows, but where the rest would
be missed. The pose is right (drift is not seen). The start is free for `start_bubble_m` or as far as it
is in truth, whichever is less; out of what was not seen around it the vehicle creeps, at `creep_mps`,
as long as the cell of its centre was seen. A vehicle that is pushed off, or that fell behind, stops in
a straight line. With `person_mps` it is also slow enough everywhere to stop before somebody who steps
out of a place that is hidden now; whoever is in sight is the planner's and the trigger's.

Source: Tordesillas, Lopez, Everett and How, FASTER, T-RO 2021; Ren et al., SUPER, Science Robotics 2025.
There a second trajectory is the back-up; here the plan's own way is, slowed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from uavexp.arrays import Bool, Float
from uavexp.braking import jerk_mps3
from uavexp.errors import require
from uavexp.pace import pace_over
from uavexp.parameters import (
    NarrowClearance,
    NarrowSpeed,
    NonNegative,
    Positive,
    PositiveShare,
    above,
    at_most,
    option,
)
from uavexp.safety.base import Flyable, Guard
from uavexp.safety.hidden import PERSON_M, walks_m
from uavexp.safety.looked_at import look_at
from uavexp.safety.speed_profile import (
    Effort,
    Way,
    fastest_rates,
    room_before_person_m,
    speed_before_person_mps,
)
from uavexp.trajectory import Trajectory, derivative, evaluate
from uavexp.types import Limits, Observation, Squeeze

_SAMPLE_S = 0.02  # at 2.5 m/s half a voxel apart
_MOST_SAMPLES = 400
_APART = 1e-6  # samples between two that are not one
_PERIODS_S = 0.2  # two ESDF updates: what was ahead is ahead until then
_HERE_M = 1e-3  # so near, the vehicle is there already
_NOISE_M = 0.01  # a smaller drop of the clearance is none
_SLOW_MPS = 1e-3
_SOON_S = 0.2  # in which a difference of velocity becomes one of place, before the controller has mended it
_LEAST_ROOM_M = 0.05


@option(frozen=True)
class Committed:
    """Slows a plan along its way so that it comes to rest in what was seen to be free; see the module."""

    margin_m: NonNegative = 0.02  # m, a place is verified where the clearance keeps body radius + this [ours]
    spare_m: NonNegative = 0.1  # m, the rest is so far before the end of what is verified: what the vehicle
    # overshoots [ours]
    comfort_share: Annotated[float, above(0), at_most(1)] = 0.7  # of the acceleration limit, for slowing
    # along the way and speeding up again [ours]
    reaction_s: NonNegative = 0.4  # s, slowing begins so much earlier: the thrust has to be turned
    # around [ours]
    turn_share: PositiveShare = 0.3  # of the body rate limit, with which the thrust is turned for it [ours]
    plan_turn_share: PositiveShare = 0.5  # of the body rate limit; a plan that turns the thrust faster is
    # flown slower there [ours]
    narrow_clearance_m: NarrowClearance = 0.22  # m, clearance of narrow places, which are flown slowly [ours]
    narrow_speed_mps: NarrowSpeed = 1.0  # m/s, in narrow places [ours]
    creep_mps: NonNegative = 0.3  # m/s, out of a place whose surroundings were not seen [ours]
    person_mps: NonNegative = 0.0  # m/s, of somebody who may step out of the nearest hidden place (`hidden`):
    # the vehicle can always stop before; 0: nobody does [ours]
    stop_error_m: Positive = 0.25  # m, tracking error at which time stands; from half of it on it runs
    # slower [ours]

    def begin(self, limits: Limits) -> Guard:
        """Begin a trial."""
        require(limits.max_acceleration_mps2 > 0.0, "max_acceleration_mps2 must be > 0 to stop")
        return _Commitment(self, limits)


@dataclass(frozen=True, slots=True)
class _Ahead:
    """A plan from now on, as far as a stop may take."""

    own_s: Float  # (N,) of the plan
    way: Way
    jerk_mps3: Float  # (N,)
    point_m: Float  # (N, 3)
    along_m: Float  # (N,) length of the way
    ends: bool  # whether the plan ends within


@dataclass(frozen=True, slots=True)
class _Commitment:
    """`Committed` in one trial."""

    rules: Committed
    limits: Limits

    def must_brake(self, observation: Observation) -> bool:
        """Return False: it stops along the way."""
        return False

    def flyable(
        self,
        plan: Trajectory,
        start_s: float,
        rate: tuple[float, float],
        observation: Observation,
        *,
        stops: bool = False,
        squeeze: Squeeze | None = None,
    ) -> Flyable:
        """The fastest pace that rests within what is verified (`Guard.flyable`)."""
        if start_s >= plan.end_s - _APART * _SAMPLE_S:
            return Flyable()
        ahead = self._ahead(plan, start_s)
        clearance_m, verified, bound_mps = self._verified(ahead, observation, squeeze)
        rest = len(verified)
        if not (ahead.ends and verified.all()):
            end = len(verified) - 1 if verified.all() else int(np.argmin(verified)) - 1
            rest = int(np.searchsorted(ahead.along_m, ahead.along_m[end] - self.rules.spare_m, side="right"))
            rest = max(min(rest, end), int(np.searchsorted(ahead.along_m, _HERE_M, side="right")) - 1)
        top = 0.0 if stops else self._top_rate(ahead, clearance_m, observation)
        bound = np.minimum(bound_mps / np.maximum(ahead.way.speed_mps, _SLOW_MPS), top)
        turning_mps3 = self.rules.plan_turn_share * jerk_mps3(self.limits)
        bound = np.minimum(bound, np.cbrt(turning_mps3 / np.maximum(ahead.jerk_mps3, turning_mps3)))
        rates, early_s, kept = fastest_rates(ahead.way, rate, bound, rest, self._effort)
        refused = "" if kept else f"no stop from {rate[0] * ahead.way.speed_mps[0]:.2f} m/s in what was seen"
        return Flyable(pace_over(start_s, ahead.own_s, rates, early_s), refused)

    @property
    def _look_m(self) -> float:
        """How far ahead a rest still bounds the speed: a stop from the speed limit, and some spare."""
        rules, fastest_mps = self.rules, self.limits.max_speed_mps
        stop_m = fastest_mps**2 / (2.0 * rules.comfort_share * self.limits.max_acceleration_mps2)
        return 1.2 * stop_m + (rules.reaction_s + _PERIODS_S) * fastest_mps + rules.spare_m

    @property
    def _effort(self) -> Effort:
        most_mps2 = self.limits.max_acceleration_mps2
        comfort_mps2 = self.rules.comfort_share * most_mps2
        return Effort(
            comfort_mps2, most_mps2, self.rules.turn_share * jerk_mps3(self.limits), self.rules.reaction_s
        )

    def _ahead(self, plan: Trajectory, start_s: float) -> _Ahead:
        """Samples of the plan for a stopping distance and what is spared."""
        # at the same places at every update, so that a rest at one of them comes
        first = math.floor((start_s - plan.start_s) / _SAMPLE_S + _APART) + 1
        # none twice, nor where the plan ends, which comes last
        count = min(math.ceil((plan.end_s - plan.start_s) / _SAMPLE_S - _APART), first + _MOST_SAMPLES)
        places_s = plan.start_s + _SAMPLE_S * np.arange(first, count, dtype=np.float64)
        own_s = np.concatenate([[start_s], places_s])
        if count < first + _MOST_SAMPLES:
            own_s = np.append(own_s, plan.end_s)
        point_m, velocity, acceleration = evaluate(plan, own_s)
        along_m = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(point_m, axis=0), axis=1)))
        far = int(np.searchsorted(along_m, self._look_m)) + 1
        velocity, acceleration = velocity[:far], acceleration[:far]
        speed = np.linalg.norm(velocity, axis=1)
        along = (velocity * acceleration).sum(axis=1) / np.maximum(speed, _SLOW_MPS)
        across = np.sqrt(np.maximum((acceleration**2).sum(axis=1) - along**2, 0.0))
        way = Way(np.diff(own_s[:far]), speed, along, across)
        ends = far >= len(own_s) and own_s[-1] == plan.end_s
        jerk = np.linalg.norm(derivative(plan, own_s[:far], 3), axis=1)
        return _Ahead(own_s[:far], way, jerk, point_m[:far], along_m[:far], ends)

    def _verified(
        self, ahead: _Ahead, observation: Observation, squeeze: Squeeze | None
    ) -> tuple[Float, Bool, Float]:
        """Of each place (N,): mapped distance, whether it is verified, or left, and the speed it bounds."""
        rules, field, radius_m = self.rules, observation.field, self.limits.body_radius_m
        half_height_m = 0.5 * self.limits.body_size_m[2]
        clearance_m, seen, centre = look_at(
            ahead.point_m,
            field.distance,
            field.state,
            field.origin_m,
            field.voxel_size_m,
            radius_m,
            half_height_m,
        )
        wide_m = radius_m + rules.margin_m
        narrow_m, narrow_mps = rules.narrow_clearance_m, rules.narrow_speed_mps
        if squeeze is not None and squeeze.clearance_m < narrow_m:
            narrow_m, narrow_mps = squeeze.clearance_m, min(squeeze.speed_mps, narrow_mps)
        near = clearance_m < min(narrow_m, wide_m)
        leaves = _leading(near) & (clearance_m >= clearance_m[0] - _NOISE_M)
        creeps = _leading(~seen) & centre & (ahead.along_m <= 2.0 * radius_m)
        verified = (~near | leaves) & (seen | creeps)
        verified[ahead.along_m <= _HERE_M] = True
        bound_mps = np.where(clearance_m < wide_m, narrow_mps, np.inf)
        bound_mps[creeps] = np.minimum(bound_mps[creeps], rules.creep_mps)
        return clearance_m, verified, np.minimum(bound_mps, self._before_person_mps(ahead, observation))

    def _before_person_mps(self, ahead: _Ahead, observation: Observation) -> Float | float:
        """Speed (N,) from which it stops before somebody who steps out of a hidden place is there.

        At least `creep_mps`: slower than anybody walks it goes on.
        """
        rules, limits = self.rules, self.limits
        if rules.person_mps == 0.0:
            return np.inf
        stop = (rules.person_mps, limits.max_acceleration_mps2, rules.reaction_s)
        apart_m = limits.body_radius_m + PERSON_M
        far_m = room_before_person_m(limits.max_speed_mps, *stop) + apart_m
        walk_m = walks_m(observation.field, observation.state.position_m, ahead.point_m, far_m)
        return np.maximum(speed_before_person_mps(walk_m - apart_m, *stop), rules.creep_mps)

    def _top_rate(self, ahead: _Ahead, clearance_m: Float, observation: Observation) -> Float:
        """Rates (N,): 1 for a vehicle that is near its reference, down to 0.

        Where the body has less room than `stop_error_m` beside the way soon to come, it falls sooner.
        """
        reference, state = observation.reference, observation.state
        lag_m = reference.position_m - state.position_m
        error_m = float(np.linalg.norm(lag_m))
        soon_m = lag_m + _SOON_S * (reference.velocity_mps - state.velocity_mps)
        most_m = max(error_m, float(np.linalg.norm(soon_m)))
        room_m = np.maximum(clearance_m - 0.5 * min(self.limits.body_size_m[:2]), _LEAST_ROOM_M)
        room_m[ahead.own_s > ahead.own_s[0] + self.rules.reaction_s] = np.inf
        left = np.minimum(1.0 - error_m / self.rules.stop_error_m, 1.0 - most_m / room_m)
        return np.asarray(np.clip(2.0 * left, 0.0, 1.0))


def _leading(flags: Bool) -> Bool:
    """Of flags (N,) those before the first that is not set."""
    return np.asarray(np.logical_and.accumulate(flags))

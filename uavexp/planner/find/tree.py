"""DF-BIT*: batch informed trees with a dynamics filter and reachability pruning (METHODS.md, paper 4).

`edges: kinodynamic` [ours]: states have a velocity; an edge is the cubic motion of least time that
keeps ‖v‖ <= v_max and ‖a‖ <= a_max on the whole of it (`cubic_motion` says why the cubic), the cost is
time, and pruning uses the least time within the limits. Time because with velocity in the state the
shortest path is always the slowest; its length is reported. Two samples with velocities drawn blindly
are hardly ever joined by such a motion, so the search is led: a few batches on straight edges from where
the vehicle can stop give a path, whose corners, passed at rest, join the first batch. There is then
always a solution, and later batches scatter about the best one.

`edges: straight`, the paper's form: straight lines no longer than `max_edge_m`, the cost is length, and
the filter is on corners (`batch_tree.edges`). The path is timed by the shaper, as every geometric path.

`dynamics_filter: false` is plain BIT* on straight edges, in the same code.

The paper's numbers: batch_samples 100, max_edge_m 0.5; with that edge length a building takes tens of
thousands of samples, hence the default here. Half of each batch is drawn near the best solution [ours]
(as in RRT*-Smart, Islam et al. 2012), the other half keeps BIT*'s guarantee.

The motion of a kinodynamic path is its cubics themselves: within the limits, but its acceleration
steps at the states, and at the start from the one requested. It is for looking at, not for flying.

Budgets are batches and iterations (edges taken from the heap); the best solution never gets worse.
"""

from __future__ import annotations

import math
from dataclasses import replace
from enum import StrEnum
from typing import Annotated

import numpy as np

from uavexp.arrays import Float
from uavexp.braking import REST_MPS
from uavexp.parameters import Count, NonNegative, Positive, Whole, at_least, below, option
from uavexp.planner.constraints import Constraints
from uavexp.planner.find.base import FoundPath
from uavexp.planner.find.batch_tree.batch import Budget, Found, search
from uavexp.planner.find.batch_tree.cubic_motion import cubic_coefficients
from uavexp.planner.find.batch_tree.edges import EdgeRule
from uavexp.planner.find.ends import refusal
from uavexp.planner.find.free_space import FreeSpace, for_motions, space_of, straight_is_free
from uavexp.planner.shape.timing import STEP_M, resample, smooth, time_profile
from uavexp.trajectory import Trajectory
from uavexp.types import Limits, PlanRequest, PlanStatus

_NO_SEEDS = np.zeros((0, 6)), 0.0
_SAMPLE_M = 0.1  # spacing of the points handed to the shaper
_ROUNDINGS = 10  # of the guide
_SEED_EVERY = 8  # steps of STEP_M between seeds along it
_SEED_SHARE = 0.85  # of the speed limit; the square of it of the acceleration's


class Edges(StrEnum):
    """What joins two samples."""

    KINODYNAMIC = "kinodynamic"
    STRAIGHT = "straight"


@option
class Tree:
    """Dynamically feasible BIT*."""

    edges: Edges = Edges.KINODYNAMIC  # kinodynamic: velocity in the state, least-time motions [ours] |
    # straight: the paper's
    dynamics_filter: bool = True  # false: plain geometric BIT* on straight edges, whatever edges says
    corner_speed_mps: NonNegative = 1.0  # m/s, filter of straight edges: least speed at which a corner can
    # be rounded within the nearer halves of its edges [ours]
    max_edge_m: Positive = 6.0  # m, longest edge; the paper's 0.5 takes tens of thousands of samples in a
    # building
    batch_samples: Count = 100  # samples of a batch (paper 4)
    first_batches: Count = 40  # at most until there is a solution, in each of the two searches
    batches: Whole = 8  # after that; the budget in samples
    guide_batches: Whole = 8  # the same of the straight search that leads the kinodynamic one [ours]
    max_iterations: Count = 200_000  # edges taken from the heap, in each of the two
    local_share: Annotated[float, at_least(0), below(1)] = 0.5  # 1, share of a batch drawn near the best
    # solution once there is one; 0: BIT* proper [ours]
    local_spread_m: Positive = 0.3  # m, greatest standard deviation of those [ours]
    rewire_factor: Positive = 1.1  # 1, on the radius of the random geometric graph; > 1 keeps asymptotic
    # optimality

    def find(self, request: PlanRequest, constraints: Constraints, rng: np.random.Generator) -> FoundPath:
        """Return the path, or why there is none (`Finder.find`)."""
        refused = refusal(request, constraints)
        if refused is not None:
            return refused
        rng = np.random.Generator(np.random.PCG64(int(rng.integers(2**63))))
        space, limits = space_of(request, constraints), constraints.limits
        start = np.concatenate([request.position_m, request.velocity_mps])
        goal = np.concatenate([request.goal.position_m, np.zeros(3)])
        if self.dynamics_filter and self.edges is Edges.KINODYNAMIC:
            return self._find_motion(space, start, goal, limits, request.time_s, rng)
        rule = self._rule(limits, self.corner_speed_mps if self.dynamics_filter else 0.0)
        return _straight(search(space, start, goal, *_NO_SEEDS, rule, self._budget(self.batches), rng))

    def _find_motion(
        self,
        space: FreeSpace,
        start: Float,
        goal: Float,
        limits: Limits,
        time_s: float,
        rng: np.random.Generator,
    ) -> FoundPath:
        """Guide on straight edges, then states with velocity; the guide alone where those fail."""
        stop = _stopped(start, limits)
        moving = float(np.linalg.norm(start[3:])) > REST_MPS
        clear = not moving or straight_is_free(space, start, stop)[0]
        begin = stop if clear else np.concatenate([start[:3], np.zeros(3)])
        rule = self._rule(limits, 0.0)
        guide = search(space, begin, goal, *_NO_SEEDS, rule, self._budget(self.guide_batches), rng)
        if len(guide.path) == 0 or not clear:
            return _straight(guide)
        seeds, reach_m = _seeds(guide.path, limits)
        top = max(limits.max_speed_mps, float(np.linalg.norm(start[3:])))  # a start may be a little beyond
        rule = rule._replace(kinodynamic=True, top_mps=top)
        found = search(for_motions(space), start, goal, seeds, reach_m, rule, self._budget(self.batches), rng)
        spent = found._replace(
            iterations=guide.iterations + found.iterations, checks=guide.checks + found.checks
        )
        if len(found.path) == 0:
            path = np.concatenate([start[None, :3], guide.path[:, :3]]) if moving else guide.path[:, :3]
            return _answer(spent, path, "straight edges: no motion within the budget")
        spent.history[:, 0] += guide.iterations
        path, times = _sampled(found)
        return replace(_answer(spent, path, ""), times_s=times, motion=_motion(found, time_s))

    def _rule(self, limits: Limits, corner_mps: float) -> EdgeRule:
        return EdgeRule(
            False, corner_mps, self.max_edge_m, limits.max_speed_mps, limits.max_acceleration_mps2
        )

    def _budget(self, batches: int) -> Budget:
        return Budget(
            self.first_batches,
            batches,
            self.batch_samples,
            self.max_iterations,
            self.local_share,
            self.local_spread_m,
            self.rewire_factor,
        )


def _straight(found: Found) -> FoundPath:
    """Answer of a search on straight edges."""
    reason = f"not found with {found.samples} samples in {found.iterations} iterations"
    return _answer(found, found.path[:, :3], "" if len(found.path) else reason)


def _answer(found: Found, path: Float, reason: str) -> FoundPath:
    return FoundPath(
        status=PlanStatus.OK if len(path) else PlanStatus.NO_PATH,
        reason=reason,
        path_m=path,
        cost=float(found.history[-1, 1]) if len(found.history) else np.inf,
        expansions=found.iterations,
        checks=found.checks,
        history=found.history,
        tree_m=found.edges,
    )


def _stopped(start: Float, limits: Limits) -> Float:
    """State (6,) of rest after the shortest straight stop from a state."""
    speed = float(np.linalg.norm(start[3:]))
    stop = np.zeros(6)
    stop[:3] = start[:3] + 0.5 * speed / limits.max_acceleration_mps2 * start[3:]
    return stop


def _seeds(guide: Float, limits: Limits) -> tuple[Float, float]:
    """States (S, 6) along a straight-edged path (P, 6), and its longest edge, m.

    Its corners at rest, which are surely joined, and points of its rounded course at the speed and
    in the direction of the time-optimal traversal, slowed down a little.
    """
    longest = float(np.linalg.norm(np.diff(guide[:, :3], axis=0), axis=1).max())
    course = smooth(resample(guide[:, :3], STEP_M), _ROUNDINGS)
    most = _SEED_SHARE * limits.max_speed_mps, _SEED_SHARE**2 * limits.max_acceleration_mps2
    times = time_profile(course, 0.0, 0.0, *most)
    velocity = np.gradient(course, times, axis=0) if len(course) > 2 else np.zeros_like(course)
    every = np.arange(_SEED_EVERY, len(course) - 1, _SEED_EVERY)
    flown = np.concatenate([course[every], velocity[every]], axis=1)
    return np.concatenate([guide, flown]), longest


def _motion(found: Found, time_s: float) -> Trajectory:
    """The motions themselves, begun at a time."""
    cubics = [cubic_coefficients(*found.path[n : n + 2], step) for n, step in enumerate(found.steps)]
    breaks_s = time_s + np.concatenate([[0.0], np.cumsum(found.steps)])
    return Trajectory(breaks_s=breaks_s, coefficients=np.stack(cubics), at_rest=True)


def _sampled(found: Found) -> tuple[Float, Float]:
    """Points (P, 3) and their times (P,) along the motions of a path."""
    points, times, passed = [found.path[:1, :3]], [np.zeros(1)], 0.0
    for n, duration in enumerate(found.steps):
        coefficients = cubic_coefficients(found.path[n], found.path[n + 1], duration)
        length = float(np.linalg.norm(found.path[n + 1, :3] - found.path[n, :3]))
        local = np.linspace(0.0, duration, max(math.ceil(length / _SAMPLE_M), 4) + 1)[1:]
        points.append(np.vander(local, 4, increasing=True) @ coefficients)
        times.append(passed + local)
        passed += duration
    return np.concatenate(points), np.concatenate(times)

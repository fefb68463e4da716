"""DF-BIT*: batch informed trees with a dynamics filter and reachability pruning (METHODS.md, paper 4).

`edges: kinodynamic` [ours]: states have a velocity; an edge is the cubic motion of least time that
keeps ‖v‖ <= v_max and ‖a‖ <= a_max on the whole of it (`motion` says why the cubic), the cost is time,
and pruning uses the least time within the limits. Time because with velocity in the state the shortest
path is always the slowest; its length is reported. Two samples with velocities drawn blindly are
hardly ever joined by such a motion, so the search is led: a few batches on straight edges from where
the vehicle can stop give a path, whose corners, passed at rest, join the first batch. There is then
always a solution, and later batches scatter about the best one.

`edges: straight`, the paper's form: straight lines no longer than `max_edge_m`, the cost is length, and
the filter is on corners (`batch_tree`). The path is timed by the smoother, as every geometric path.

`dynamics_filter: false` is plain BIT* on straight edges, in the same code.

The paper's numbers: batch_samples 100, max_edge_m 0.5; with that edge length a building takes tens of
thousands of samples, hence the default here. Half of each batch is drawn near the best solution [ours]
(as in RRT*-Smart, Islam et al. 2012), the other half keeps BIT*'s guarantee.

Without smoothing a kinodynamic plan is its cubics themselves: within the limits, but its acceleration
steps at the states, and at the start from the one requested. It is for looking at, not for flying.

Budgets are batches and iterations (edges taken from the heap); the best solution never gets worse.
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, field
from enum import StrEnum

import numpy as np

from uavexp.arrays import Float
from uavexp.errors import require, require_non_negative, require_option, require_positive
from uavexp.planner.find.free_space import FreeSpace, for_motions, straight_is_free
from uavexp.planner.find.sampling import (
    FoundWay,
    finish,
    refusal,
    require_known_or_not,
    require_whole,
    space_of,
)
from uavexp.planner.find.tree.batch import Budget, Found, search
from uavexp.planner.find.tree.edges import Rule
from uavexp.planner.find.tree.motion import cubic_coefficients
from uavexp.planner.movers.among import plan_among
from uavexp.planner.shape import Smoothing, make_smoother
from uavexp.planner.shape.base import Smoother
from uavexp.planner.shape.timing import STEP_M, resample, smooth, time_profile
from uavexp.types import Limits, PlanRequest, PlanResult

_NO_SEEDS = np.zeros((0, 6)), 0.0
_SAMPLE_M = 0.1  # spacing of the points handed to the smoother
_ROUNDINGS = 10  # of the guide
_SEED_EVERY = 8  # steps of STEP_M between seeds along it
_SEED_SHARE = 0.85  # of the speed limit; the square of it of the acceleration's
_REST_MPS = 0.05  # a slower start counts as standing


class Edges(StrEnum):
    """What joins two samples."""

    KINODYNAMIC = "kinodynamic"
    STRAIGHT = "straight"


@dataclass(slots=True, kw_only=True)
class DfBitstar:
    """Dynamically feasible BIT*, smoothed."""

    min_clearance_m: float = 0.26
    z_band_m: float = 0.3
    unknown: str = "optimistic"
    edges: Edges = Edges.KINODYNAMIC
    dynamics_filter: bool = True
    corner_speed_mps: float = 1.0
    max_edge_m: float = 6.0
    batch_samples: int = 100
    first_batches: int = 40
    batches: int = 8
    guide_batches: int = 8
    max_iterations: int = 200_000
    local_share: float = 0.5
    local_spread_m: float = 0.3
    rewire_factor: float = 1.1
    mover_margin_m: float = 0.5
    mover_horizon_s: float = 2.0
    smoothing: Smoothing = Smoothing.BSPLINE_QP
    derivative: str = "acceleration"
    _limits: Limits | None = field(default=None, init=False, repr=False)
    _smoother: Smoother | None = field(default=None, init=False, repr=False)
    _seed: int = field(default=0, init=False, repr=False)

    def __post_init__(self) -> None:
        require_positive(
            min_clearance_m=self.min_clearance_m,
            max_edge_m=self.max_edge_m,
            local_spread_m=self.local_spread_m,
            rewire_factor=self.rewire_factor,
        )
        require_non_negative(
            mover_margin_m=self.mover_margin_m,
            mover_horizon_s=self.mover_horizon_s,
            z_band_m=self.z_band_m,
            corner_speed_mps=self.corner_speed_mps,
            local_share=self.local_share,
        )
        require(self.local_share < 1.0, f"local_share must be in [0, 1), got {self.local_share}")
        require_whole(
            batch_samples=self.batch_samples,
            first_batches=self.first_batches,
            batches=self.batches,
            guide_batches=self.guide_batches,
            max_iterations=self.max_iterations,
        )
        require_known_or_not(self.unknown)
        self.edges = require_option("edges", self.edges, Edges)
        self.smoothing = require_option("smoothing", self.smoothing, Smoothing)
        self._smoother = make_smoother(self.smoothing, self.derivative)

    def reset(self, limits: Limits, rng: np.random.Generator) -> None:
        """Begin a trial of a vehicle with these limits; every request draws from the same new stream."""
        self._limits = limits
        self._seed = int(rng.integers(2**63))

    def plan(self, request: PlanRequest) -> PlanResult:
        """Return a trajectory or the reason why there is none (`Planner.plan`)."""
        if self._limits is None:
            raise RuntimeError("plan() needs reset() first")
        return plan_among(
            request,
            self._plan,
            self._limits,
            margin_m=self.mover_margin_m,
            horizon_s=self.mover_horizon_s,
            min_clearance_m=self.min_clearance_m,
            known_only=self.unknown == "conservative",
        )

    def _plan(self, request: PlanRequest) -> PlanResult:
        """Plan in the map as it is."""
        assert self._limits is not None
        assert self._smoother is not None
        began_s = time.perf_counter()
        known_only = self.unknown == "conservative"
        refused = refusal(request, self._limits, self.min_clearance_m, known_only)
        if refused is not None:
            return PlanResult(status=refused.status, reason=refused.reason)
        space = space_of(request, self.min_clearance_m, self.z_band_m, known_only)
        found = self._find(request, space, self._limits)
        return finish(request, found, self._smoother, self._limits, self.min_clearance_m, known_only, began_s)

    def _find(self, request: PlanRequest, space: FreeSpace, limits: Limits) -> FoundWay:
        """Search in the chosen form."""
        rng = np.random.Generator(np.random.PCG64(self._seed))
        start = np.concatenate([request.position_m, request.velocity_mps])
        goal = np.concatenate([request.goal.position_m, np.zeros(3)])
        if not self.dynamics_filter or self.edges is Edges.STRAIGHT:
            corner = self.corner_speed_mps if self.dynamics_filter else 0.0
            found = search(
                space, start, goal, *_NO_SEEDS, self._rule(limits, corner), self._budget(self.batches), rng
            )
            return _way(found, found.path[:, :3], None, self._failure(found))
        return self._find_motion(space, start, goal, limits, rng)

    def _find_motion(
        self, space: FreeSpace, start: Float, goal: Float, limits: Limits, rng: np.random.Generator
    ) -> FoundWay:
        """Guide on straight edges, then states with velocity; the guide alone where those fail."""
        stop = _stopped(start, limits)
        moving = float(np.linalg.norm(start[3:])) > _REST_MPS
        clear = not moving or straight_is_free(space, start, stop)[0]
        begin = stop if clear else np.concatenate([start[:3], np.zeros(3)])
        guide = search(
            space, begin, goal, *_NO_SEEDS, self._rule(limits, 0.0), self._budget(self.guide_batches), rng
        )
        if len(guide.path) == 0 or not clear:
            path = guide.path[:, :3]
            return _way(guide, path, None, self._failure(guide))
        seeds, reach_m = _seeds(guide.path, limits)
        top = max(limits.max_speed_mps, float(np.linalg.norm(start[3:])))  # a start may be a little beyond
        rule = self._rule(limits, 0.0)._replace(kinodynamic=True, top_mps=top)
        found = search(for_motions(space), start, goal, seeds, reach_m, rule, self._budget(self.batches), rng)
        spent = found._replace(
            iterations=guide.iterations + found.iterations, checks=guide.checks + found.checks
        )
        if len(found.path) == 0:
            path = np.concatenate([start[None, :3], guide.path[:, :3]]) if moving else guide.path[:, :3]
            return _way(spent, path, None, "straight edges: no motion within the budget")
        spent.history[:, 0] += guide.iterations
        path, times = _sampled(found)
        way = _way(spent, path, times, "")
        return way._replace(pieces=_pieces(found)) if self.smoothing is Smoothing.NONE else way

    def _rule(self, limits: Limits, corner_mps: float) -> Rule:
        return Rule(False, corner_mps, self.max_edge_m, limits.max_speed_mps, limits.max_acceleration_mps2)

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

    def _failure(self, found: Found) -> str:
        if len(found.path) > 0:
            return ""
        return f"not found with {found.samples} samples in {found.iterations} iterations"


def _way(found: Found, path: Float, times: Float | None, reason: str) -> FoundWay:
    return FoundWay(path, times, found.history, found.iterations, found.checks, reason, tree=found.edges)


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


def _pieces(found: Found) -> tuple[Float, Float]:
    """Breaks (K + 1,), s from the start, and coefficients (K, 4, 3) of the motions themselves."""
    motions = [cubic_coefficients(*found.path[n : n + 2], step) for n, step in enumerate(found.steps)]
    return np.concatenate([[0.0], np.cumsum(found.steps)]), np.stack(motions)


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

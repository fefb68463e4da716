"""When a policy would have replanned along a recorded path: map, explorer and trigger, nothing flies.

The plan is the way that was really gone: at each request it is the rest of the recorded path, judged from
then on against the map as it was at the request. So the trigger is asked what it is asked in flight, whether
the plan still holds on what is seen now, and nothing depends on a planner or a vehicle that were not there.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.interpolate import CubicSpline

from uavexp import causes
from uavexp.answers import ask
from uavexp.arrays import Float
from uavexp.config.build import build
from uavexp.config.composition import Cell
from uavexp.errors import require
from uavexp.geometry import quaternion_from_rotation
from uavexp.path_clearance import clearance_ahead_m
from uavexp.replay.recorded import Frame, Recorded
from uavexp.scene import Scene
from uavexp.trajectory import Trajectory, evaluate
from uavexp.trial import Parts
from uavexp.types import Decision, Goal, MapUpdate, Observation, Reference, State

_MARGIN_M = 0.5  # of the map around the path, beyond the camera's range
_TIME_S = 1e-5  # stamps since 1970 are no more exact
_NOTHING = Scene.from_mesh(np.zeros((0, 3), np.float32), np.zeros((0, 3), np.int32))  # truth is not known


@dataclass(frozen=True, slots=True, kw_only=True)
class Request:
    """A plan that would have been asked for."""

    time_s: float
    cause: str
    score: float
    position_m: Float  # (3,)


@dataclass(frozen=True, slots=True, kw_only=True)
class Asked:
    """What one policy would have done."""

    name: str
    requests: tuple[Request, ...]  # the first plan is number 0
    tick_s: Float  # (M,) updates of the map
    score: Float  # (M,) the trigger's
    clearance_m: Float  # (M,) least mapped distance ahead on the path

    @property
    def replans(self) -> tuple[Request, ...]:
        """Those after the first plan."""
        return self.requests[1:]


@dataclass(slots=True, kw_only=True)
class _Policy:
    """A policy at work."""

    parts: Parts
    path: Trajectory
    settle_s: float
    plan: Trajectory | None = None
    goal: Goal | None = None
    best_goal: Goal | None = None
    chooses_s: float = 0.0
    requests: list[Request] = field(default_factory=list)
    rows: list[tuple[float, float, float]] = field(default_factory=list)

    def see(self, seen: Observation) -> None:
        """Choose a goal when that is due, and ask the trigger."""
        if seen.time_s >= self.chooses_s - _TIME_S:
            self.best_goal = self.parts.explorer.select(seen)
            self.chooses_s = seen.time_s + 1.0 / self.parts.explorer.rate_hz
        seen = replace(seen, trajectory=self.plan, goal=self.goal, best_goal=self.best_goal)
        if self.plan is None:
            if seen.time_s >= self.settle_s - _TIME_S:
                self._request(causes.FIRST.name, 0.0, seen)
            return
        decision = ask(Decision, self.parts.trigger.decide, seen)
        clearance_m = clearance_ahead_m(self.plan, seen.field, seen.time_s)
        least_m = float(clearance_m.min()) if len(clearance_m) else math.nan
        self.rows.append((seen.time_s, decision.score, least_m))
        if decision.replan:
            self._request(decision.cause, decision.score, seen)

    def _request(self, cause: str, score: float, seen: Observation) -> None:
        plan = _rest(self.path, seen.time_s)
        if plan is None:
            return
        self.plan = plan
        self.goal = self.best_goal = self.parts.explorer.select(seen, fresh=True)
        self.parts.trigger.planned(plan, seen.field)
        request = Request(time_s=seen.time_s, cause=cause, score=score, position_m=seen.state.position_m)
        self.requests.append(request)


def asked(recorded: Recorded, cell: Cell, name: str) -> Asked:
    """Take a recording through the map of a cell and ask its trigger after each update.

    Raises:
        ConfigError: a part cannot do without a world.
        RecordError: an image is damaged.
    """
    parts = build(cell.config)
    max_range_m = float(getattr(parts.sensor, "max_range_m", math.nan))
    require(max_range_m > 0.0, f"sensor={cell.options['sensor']} has no max_range_m for depth images")
    places_m = np.array([frame.position_m for frame in recorded.frames])
    bounds_m = np.stack([places_m.min(axis=0), places_m.max(axis=0)])
    around = np.array([[-1.0], [1.0]])
    flight_bounds_m = bounds_m + _MARGIN_M * around
    parts.mapping.reset(flight_bounds_m + max_range_m * around, _NOTHING)
    parts.trigger.reset(parts.vehicle.limits)
    parts.explorer.reset(float(places_m[0, 2]), parts.vehicle.limits)
    path = _path(recorded.frames)
    settle_s = float(getattr(parts.pilot, "settle_s", 0.0))
    policy = _Policy(parts=parts, path=path, settle_s=settle_s)
    due_s = 0.0
    for frame in recorded.frames:
        parts.mapping.integrate(recorded.scan(frame, max_range_m))
        if frame.time_s >= due_s - _TIME_S:
            update = parts.mapping.update(frame.time_s)
            due_s = frame.time_s + 1.0 / parts.mapping.esdf_rate_hz
            policy.see(_observation(frame, path, parts, update, places_m[-1], flight_bounds_m))
    tick_s, score, clearance_m = np.array(policy.rows).reshape(-1, 3).T
    return Asked(
        name=name, requests=tuple(policy.requests), tick_s=tick_s, score=score, clearance_m=clearance_m
    )


def _observation(
    frame: Frame, path: Trajectory, parts: Parts, update: MapUpdate, target_m: Float, flight_bounds_m: Float
) -> Observation:
    """What a trigger sees there: the vehicle is where the camera was, on its reference."""
    position_m, velocity_mps, acceleration_mps2 = (
        item[0] for item in evaluate(path, np.array([frame.time_s]))
    )
    forward = frame.body_rotation[:, 0]
    return Observation(
        time_s=frame.time_s,
        state=State(
            position_m=position_m,
            velocity_mps=velocity_mps,
            quaternion_wxyz=quaternion_from_rotation(frame.body_rotation),
            body_rate_radps=np.zeros(3),
        ),
        reference=Reference(
            position_m=position_m,
            velocity_mps=velocity_mps,
            acceleration_mps2=acceleration_mps2,
            yaw_rad=math.atan2(forward[1], forward[0]),
        ),
        trajectory=None,
        field=parts.mapping.field,
        update=update,
        goal=None,
        best_goal=None,
        target_m=target_m,
        flight_bounds_m=flight_bounds_m,
    )


def _path(frames: tuple[Frame, ...]) -> Trajectory:
    """The recorded positions as a curve with a continuous acceleration."""
    times_s = np.array([frame.time_s for frame in frames])
    spline = CubicSpline(times_s, np.array([frame.position_m for frame in frames]))
    coefficients = np.ascontiguousarray(np.transpose(spline.c[::-1], (1, 0, 2)))
    return Trajectory(breaks_s=times_s, coefficients=coefficients, at_rest=False)


def _rest(path: Trajectory, time_s: float) -> Trajectory | None:
    """What is left of the path from one of its breaks on; None at its end."""
    first = int(np.searchsorted(path.breaks_s, time_s - _TIME_S))
    if first >= len(path.breaks_s) - 1:
        return None
    return Trajectory(
        breaks_s=path.breaks_s[first:], coefficients=path.coefficients[first:], at_rest=path.at_rest
    )

"""From stop to stop: which viewpoint comes next, where to look, and what has been seen meanwhile.

Everything here is what the vehicle believes: its estimated pose and its live map. A stop that
the map blocks, or that no plan reaches, is put off to the end of the visit, and given up when
that happens again. With view adaptation (paper 3, algorithm 2) the yaw is the one that sees
the most that is new, and a stop is left when no yaw there would see anything worth it; without,
it is the planned one. After the last stop, more are made for what is still unseen [ours].

Among movers, while one may come near the way to the next stop, or to the stop itself, the vehicle
steps aside (`give_way`); when that takes long, one of the stops after it is visited first, and a stop
that has been waited for in vain is put off like one that is blocked [ours].
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from enum import StrEnum
from functools import cache, partial
from typing import ClassVar

import numpy as np

from uavexp.arrays import Bool, Float
from uavexp.geometry import wrap_angle, yaw_of
from uavexp.inspection.inspection_plan import InspectionPlan, Settings, adapt_order
from uavexp.inspection.view_angle import Weights, blocked_viewpoints, cell_weights, choose_yaw
from uavexp.inspection.viewpoints import Viewpoints
from uavexp.inspection.visibility import Camera, visible_cells
from uavexp.mission.give_way import HORIZON_S, aside_m, room_along_m, rooms_m
from uavexp.mission.more_stops import live_grid, more_stops
from uavexp.planner.movers.moving import turns_s
from uavexp.types import Goal, Limits, Observation

Free = Callable[[int], bool]  # whether no mover comes near on the way to a stop, or there

ALTERNATIVES = 4  # so many of the next stops may be visited before one that has to wait


class Look(StrEnum):
    """Where the vehicle looks between stops."""

    AHEAD = "ahead"
    ADAPTIVE = "adaptive"


class Stop(StrEnum):
    """What has become of a stop."""

    OPEN = "open"
    PUT_OFF = "put_off"  # once blocked or unreachable
    VISITED = "visited"
    GIVEN_UP = "given_up"


@dataclass(slots=True, kw_only=True)
class TourGuide:
    """An explorer that leads through the viewpoints of a plan.

    Attributes:
        plan: of the inspection.
        camera: that looks.
        settings: of the plan, for more stops.
        look: where to between stops.
        view_adaptation: whether the yaw is chosen anew (paper 3, algorithm 2) or the planned one.
        believes_rays: whether what a ray through the live map reaches counts as scanned; else `scanned`
            is written by who takes the images.
        arrive_m: distance from a stop at which the vehicle has arrived.
        yaw_tolerance_rad: from the wanted yaw at which it has turned there.
        dwell_s: longest stay at a stop.
        again_after_s: time from putting a stop off until it is tried again.
        blocked_below_m: mapped distance below which a stop is blocked.
        rounds: of more stops after the planned ones.
        weights: of cells for the choice of yaw.
        rate_hz: of choices.
        keep_m: of the body from predicted movers at a stop.
        patience_s: longest wait for movers on the way to a stop, in all.
    """

    explores: ClassVar[bool] = True
    plan: InspectionPlan
    camera: Camera
    settings: Settings
    look: Look
    view_adaptation: bool
    believes_rays: bool
    arrive_m: float
    yaw_tolerance_rad: float
    dwell_s: float
    again_after_s: float
    blocked_below_m: float
    rounds: int
    weights: Weights
    rate_hz: float
    keep_m: float
    patience_s: float
    scanned: Bool = field(init=False, repr=False)  # (N,) cells believed to have been seen
    visited_s: Float = field(init=False, repr=False)  # (V,) of the planned stops; inf: never
    _stops: Viewpoints = field(init=False, repr=False)
    _state: list[Stop] = field(init=False, repr=False)
    _after_s: Float = field(init=False, repr=False)  # (S,) a stop put off is not tried before
    _waited_s: Float = field(init=False, repr=False)  # (S,) for movers, since last put off
    _order: list[int] = field(init=False, repr=False)
    _blocked: Bool = field(init=False, repr=False)  # (V,) planned stops the live map has blocked
    _arrived_s: float = field(init=False, repr=False, default=math.inf)
    _waiting_s: float = field(init=False, repr=False, default=math.inf)  # since when, for movers to pass
    _aside_m: Float | None = field(init=False, repr=False, default=None)  # (3,) stepped to at present
    _yaw_rad: float = field(init=False, repr=False, default=math.nan)
    _finished: bool = field(init=False, repr=False, default=False)
    _limits: Limits | None = field(init=False, repr=False, default=None)

    def __post_init__(self) -> None:
        count = len(self.plan.viewpoints)
        self.scanned = np.zeros(len(self.plan.surface), dtype=np.bool_)
        self.visited_s = np.full(count, np.inf)
        self._blocked = np.zeros(count, dtype=np.bool_)
        self._begin(self.plan.viewpoints, [int(stop) for stop in self.plan.order])

    @property
    def finished(self) -> bool:
        """Whether every stop was visited or given up, and no more are to be made."""
        return self._finished

    def reset(self, flight_height_m: float, limits: Limits) -> None:
        """Take the vehicle's limits; nothing else is left of an earlier trial."""
        self._limits = limits

    def reject(self, position_m: Float, time_s: float) -> None:
        """No plan leads to a stop: put it off or give it up."""
        for stop in self._order:
            if self._is_open(stop) and np.array_equal(self._stops.position_m[stop], position_m):
                self._put_off(stop, time_s)
                return

    def select(self, observation: Observation, *, fresh: bool = False) -> Goal | None:
        """Return the next stop, None when none can be tried now.

        Between calls that are not `fresh` one period passes: then what the camera sees counts.
        """
        if not fresh and self.believes_rays:
            self._scan(observation)
        free: Free = cache(partial(self._is_free, observation))
        stop = self._next(observation, free)
        if stop is not None and not fresh and not self._is_left(stop, observation, free):
            free = cache(partial(self._is_free, observation))  # there may be other stops by now
            stop = self._next(observation, free)
        if stop is None:
            return None
        looks = self.look is Look.ADAPTIVE or self._has_arrived(stop, observation)
        if not fresh:
            self._yaw_rad = self._wanted_yaw_rad(stop, observation) if looks else math.nan
        place_m = self._place_m(stop, observation, free)
        return Goal(
            position_m=place_m,
            is_target=True,
            score=-float(np.linalg.norm(place_m - observation.state.position_m)),
            yaw_rad=self._yaw_rad,
        )

    def _begin(self, stops: Viewpoints, order: list[int]) -> None:
        """Go through other stops from now on."""
        self._stops, self._order = stops, order
        self._state = [Stop.OPEN] * len(stops)
        self._after_s = np.full(len(stops), -np.inf)
        self._waited_s = np.zeros(len(stops))
        self._arrived_s, self._finished = math.inf, not order

    def _is_open(self, stop: int) -> bool:
        return self._state[stop] in (Stop.OPEN, Stop.PUT_OFF)

    def _next(self, observation: Observation, free: Free) -> int | None:
        """The first stop of the order that can be tried now; makes more stops when all are done."""
        self._postpone_blocked(observation)
        left = [stop for stop in self._order if self._is_open(stop)]
        if not left and not self._finished:
            self._go_on(observation)
            left = [stop for stop in self._order if self._is_open(stop)]
        ready = [stop for stop in left if self._after_s[stop] <= observation.time_s]
        if not ready or free(ready[0]):
            self._waiting_s = math.inf
            return next(iter(ready), None)
        self._waiting_s = min(self._waiting_s, observation.time_s)
        if observation.time_s - self._waiting_s < self.again_after_s:
            return ready[0]
        other = next((stop for stop in ready[1:ALTERNATIVES] if free(stop)), ready[0])
        self._order.remove(other)
        self._order.insert(0, other)
        return other

    def _is_left(self, stop: int, observation: Observation, free: Free) -> bool:
        """Whether a stop still is to be gone to or stayed at, at the end of a period; else that is noted."""
        if self._is_done(stop, observation):
            self._note_visit(stop, observation.time_s)
            return False
        if not free(stop):
            self._waited_s[stop] += 1.0 / self.rate_hz
        if self._waited_s[stop] < self.patience_s:
            return True
        self._put_off(stop, observation.time_s, for_movers=True)
        return False

    def _is_free(self, observation: Observation, stop: int) -> bool:
        """Whether no mover may come near on the way to a stop, as flown if that is under way, or there."""
        tracks, limits, goal = observation.tracks, self._limits, observation.goal
        if limits is None or not len(tracks):
            return True
        place_m, here_m = self._stops.position_m[stop], observation.state.position_m
        turn_s = turns_s(tracks, observation.field, HORIZON_S)
        if (
            observation.trajectory is not None
            and goal is not None
            and np.array_equal(goal.position_m, place_m)
        ):
            room_m = room_along_m(tracks, turn_s, observation.trajectory, observation.time_s)
        else:
            room_m = float(rooms_m(tracks, turn_s, here_m, place_m[None], limits, way=True)[0])
        return room_m >= limits.body_radius_m + self.keep_m

    def _place_m(self, stop: int, observation: Observation, free: Free) -> Float:
        """Where to go for a stop: to it, or aside while movers come there."""
        limits = self._limits
        if limits is None or free(stop):
            self._aside_m = None
            return np.asarray(self._stops.position_m[stop])
        self._aside_m = aside_m(
            observation.tracks,
            observation.field,
            observation.reference.position_m,
            self._refuges_m(observation),
            limits.body_radius_m + self.keep_m,
            limits,
            self._aside_m,
        )
        return self._aside_m

    def _refuges_m(self, observation: Observation) -> Float:
        """Places (N, 3) to step aside to: the plan's, and as high as may be flown, over those who walk."""
        places_m = self.plan.lattice.position_m
        high_m = places_m[places_m[:, 2] == places_m[:, 2].max()].copy()
        high_m[:, 2] = observation.flight_bounds_m[1, 2]
        return np.concatenate([places_m, high_m])

    def _postpone_blocked(self, observation: Observation) -> None:
        """Put off the stops at the head of the order on which the live map shows an obstacle."""
        changed = False
        for stop in list(self._order):
            if not self._is_open(stop) or self._after_s[stop] > observation.time_s:
                continue
            place_m = self._stops.position_m[stop][None]
            if observation.field.distance_m(place_m)[0] >= self.blocked_below_m:
                break
            self._put_off(stop, observation.time_s)
            changed = True
        if changed and self._is_planned():
            self._adapt(observation)

    def _put_off(self, stop: int, time_s: float, *, for_movers: bool = False) -> None:
        again = self._state[stop] is Stop.PUT_OFF
        self._state[stop] = Stop.GIVEN_UP if again else Stop.PUT_OFF
        self._after_s[stop] = time_s + (0.0 if for_movers else self.again_after_s)
        self._waited_s[stop], self._waiting_s = 0.0, math.inf
        self._order.remove(stop)
        self._order.append(stop)
        self._arrived_s = math.inf
        if self._is_planned() and not for_movers:
            self._blocked[stop] = True

    def _adapt(self, observation: Observation) -> None:
        """Order of the open stops anew where that is worth it; those put off stay last."""
        position_m = observation.state.position_m
        order = np.array(self._order, dtype=np.int64)
        gone = [stop for stop in self._order if self._state[stop] is not Stop.OPEN]
        left = adapt_order(self.plan, order, [], gone, position_m, seed=self.settings.seed)
        self._order = [int(stop) for stop in left] + gone

    def _is_planned(self) -> bool:
        """Whether the stops are the plan's, not more of them."""
        return self._stops is self.plan.viewpoints

    def _note_visit(self, stop: int, time_s: float) -> None:
        self._state[stop], self._arrived_s = Stop.VISITED, math.inf
        if self._is_planned():
            self.visited_s[stop] = time_s

    def _has_arrived(self, stop: int, observation: Observation) -> bool:
        away_m = np.linalg.norm(self._stops.position_m[stop] - observation.state.position_m)
        return bool(away_m <= self.arrive_m)

    def _is_done(self, stop: int, observation: Observation) -> bool:
        """Whether there is nothing more to do at a stop."""
        if not self._has_arrived(stop, observation):
            self._arrived_s = math.inf
            return False
        self._arrived_s = min(self._arrived_s, observation.time_s)
        if observation.time_s - self._arrived_s >= self.dwell_s:
            return True
        if self.view_adaptation:
            new = self._newly_seen(observation, self._wanted_yaw_rad(stop, observation))
            return float(self.plan.surface.area_m2[new].sum()) < self.settings.pattern.least_new_m2
        error_rad = wrap_angle(self._stops.yaw_rad[stop] - yaw_of(observation.state.quaternion_wxyz))
        return abs(float(error_rad)) <= self.yaw_tolerance_rad

    def _wanted_yaw_rad(self, stop: int, observation: Observation) -> float:
        planned_rad = float(self._stops.yaw_rad[stop])
        if not self.view_adaptation:
            return planned_rad
        surface, views = self.plan.surface, self.plan.views
        blocked = self._blocked_now(observation)
        weight = cell_weights(surface, views, blocked, self.scanned, self.weights)
        grid, position_m = live_grid(observation.field), observation.state.position_m
        return choose_yaw(grid, self.camera, surface, weight, position_m, planned_rad).yaw_rad

    def _blocked_now(self, observation: Observation) -> Bool:
        """Planned stops (V,) not visited that were blocked or unreachable, or are blocked by the live map.

        All of them, not only those that come next: what they would have seen is to be seen from elsewhere.
        """
        places = self.plan.viewpoints
        shown = blocked_viewpoints(observation.field, places, self.blocked_below_m)
        return self._blocked | (shown & np.isinf(self.visited_s))

    def _newly_seen(self, observation: Observation, yaw_rad: float) -> Bool:
        """Cells (N,) not yet scanned that the camera would see from here with a yaw, by the live map."""
        surface, eye_m = self.plan.surface, np.ascontiguousarray(observation.state.position_m)
        grid, optics = live_grid(observation.field), self.camera.optics
        new = np.zeros(len(surface), dtype=np.bool_)
        new[visible_cells(grid, optics, eye_m, yaw_rad, surface.point_m, surface.normal, ~self.scanned)] = (
            True
        )
        return new

    def _scan(self, observation: Observation) -> None:
        self.scanned |= self._newly_seen(observation, yaw_of(observation.state.quaternion_wxyz))

    def _go_on(self, observation: Observation) -> None:
        """More stops for what the live map says can still be seen; none: the inspection is over."""
        self._finished = self.rounds == 0
        if self._finished:
            return
        self.rounds -= 1
        self._begin(
            *more_stops(self.plan.surface.part(~self.scanned), observation, self.camera, self.settings)
        )

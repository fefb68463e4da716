"""From stop to stop: which viewpoint comes next, where to look, and what has been seen meanwhile.

Everything here is what the vehicle believes: its estimated pose and its live map. A stop that
the map blocks, or that no plan reaches, is put off to the end of the visit, and given up when
that happens again. With view adaptation (paper 3, algorithm 2) the yaw is the one that sees
the most that is new, and a stop is left when no yaw there would see anything worth it; without,
it is the planned one. After the last stop, more are made for what is still unseen [ours].
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from enum import StrEnum

import numpy as np

from uavexp.geometry import wrap_angle, yaw_of
from uavexp.inspection.lattice import lattice_of
from uavexp.inspection.plan import InspectionPlan, Settings, adapt_order, path_from, sparse_places
from uavexp.inspection.travel import is_reachable, travel_lengths, travel_matrix
from uavexp.inspection.view_angle import Weights, cell_weights, choose_yaw
from uavexp.inspection.viewpoints import Viewpoints, added
from uavexp.inspection.visibility import Camera, Grid, Views, visible_cells, witnesses
from uavexp.mapping.base import DistanceField
from uavexp.types import Bool, Float, Goal, Limits, Observation


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
        arrive_m: distance from a stop at which the vehicle has arrived.
        yaw_tolerance_rad: from the wanted yaw at which it has turned there.
        dwell_s: longest stay at a stop.
        again_after_s: time from putting a stop off until it is tried again.
        blocked_below_m: mapped distance below which a stop is blocked.
        rounds: of more stops after the planned ones.
        weights: of cells for the choice of yaw.
        rate_hz: of choices.
    """

    plan: InspectionPlan
    camera: Camera
    settings: Settings
    look: Look
    view_adaptation: bool
    arrive_m: float
    yaw_tolerance_rad: float
    dwell_s: float
    again_after_s: float
    blocked_below_m: float
    rounds: int
    weights: Weights
    rate_hz: float
    scanned: Bool = field(init=False, repr=False)  # (N,) cells believed to have been seen
    visited_s: Float = field(init=False, repr=False)  # (V,) of the planned stops; inf: never
    _stops: Viewpoints = field(init=False, repr=False)
    _state: list[Stop] = field(init=False, repr=False)
    _after_s: Float = field(init=False, repr=False)  # (S,) a stop put off is not tried before
    _order: list[int] = field(init=False, repr=False)
    _blocked: Bool = field(init=False, repr=False)  # (V,) planned stops the live map has blocked
    _arrived_s: float = field(init=False, repr=False, default=math.inf)
    _yaw_rad: float = field(init=False, repr=False, default=math.nan)
    _finished: bool = field(init=False, repr=False, default=False)

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
        """Nothing is left of an earlier trial: the guide is made anew for each."""

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
        if not fresh:
            self._scan(observation)
        stop = self._next(observation)
        if stop is not None and not fresh and self._is_done(stop, observation):
            self._note_visit(stop, observation.time_s)
            stop = self._next(observation)
        if stop is None:
            return None
        looks = self.look is Look.ADAPTIVE or self._has_arrived(stop, observation)
        if not fresh:
            self._yaw_rad = self._wanted_yaw_rad(stop, observation) if looks else math.nan
        place_m = self._stops.position_m[stop]
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
        self._arrived_s, self._finished = math.inf, not order

    def _is_open(self, stop: int) -> bool:
        return self._state[stop] in (Stop.OPEN, Stop.PUT_OFF)

    def _next(self, observation: Observation) -> int | None:
        """The first stop of the order that can be tried now; makes more stops when all are done."""
        self._postpone_blocked(observation)
        left = [stop for stop in self._order if self._is_open(stop)]
        if not left and not self._finished:
            self._go_on(observation)
            left = self._order
        return next((stop for stop in left if self._after_s[stop] <= observation.time_s), None)

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

    def _put_off(self, stop: int, time_s: float) -> None:
        again = self._state[stop] is Stop.PUT_OFF
        self._state[stop] = Stop.GIVEN_UP if again else Stop.PUT_OFF
        self._after_s[stop] = time_s + self.again_after_s
        self._order.remove(stop)
        self._order.append(stop)
        self._arrived_s = math.inf
        if self._is_planned():
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
            wanted_rad = self._wanted_yaw_rad(stop, observation)
            new = self._seen_now(observation, wanted_rad) & ~self.scanned
            return float(self.plan.surface.area_m2[new].sum()) < self.settings.pattern.least_new_m2
        error_rad = wrap_angle(self._stops.yaw_rad[stop] - yaw_of(observation.state.quaternion_wxyz))
        return abs(float(error_rad)) <= self.yaw_tolerance_rad

    def _wanted_yaw_rad(self, stop: int, observation: Observation) -> float:
        planned_rad = float(self._stops.yaw_rad[stop])
        if not self.view_adaptation:
            return planned_rad
        surface, views = self.plan.surface, self.plan.views
        weight = cell_weights(surface, views, self._blocked, self.scanned, self.weights)
        grid, position_m = _grid(observation.field), observation.state.position_m
        return choose_yaw(grid, self.camera, surface, weight, position_m, planned_rad).yaw_rad

    def _seen_now(self, observation: Observation, yaw_rad: float) -> Bool:
        """Cells (N,) that the camera would see from here with a yaw, by the live map."""
        surface, seen = self.plan.surface, np.zeros(len(self.scanned), dtype=np.bool_)
        eye_m = np.ascontiguousarray(observation.state.position_m)
        grid, optics = _grid(observation.field), self.camera.optics
        seen[visible_cells(grid, optics, eye_m, yaw_rad, surface.point_m, surface.normal)] = True
        return seen

    def _scan(self, observation: Observation) -> None:
        self.scanned |= self._seen_now(observation, yaw_of(observation.state.quaternion_wxyz))

    def _go_on(self, observation: Observation) -> None:
        """More stops for what the live map says can still be seen; none: the inspection is over."""
        self._finished = self.rounds == 0
        if self._finished:
            return
        self.rounds -= 1
        self._begin(*self._more_stops(observation))

    def _more_stops(self, observation: Observation) -> tuple[Viewpoints, list[int]]:
        """Stops for the cells not yet scanned, by the live map, in the order of a short path."""
        settings, live = self.settings, observation.field
        position_m, bounds_m = observation.state.position_m, observation.flight_bounds_m
        lattice = lattice_of(
            live, bounds_m, position_m, settings.clearance_m, settings.cell_m, settings.layer_m
        )
        eyes_m, left = sparse_places(lattice), self.plan.surface.part(~self.scanned)
        witness = witnesses(_grid(live), self.camera.optics, eyes_m, left.point_m, left.normal)

        def fits(points_m: Float) -> Bool:
            inside = ((points_m >= bounds_m[0]) & (points_m <= bounds_m[1])).all(axis=1)
            return np.asarray(inside & is_reachable(lattice, points_m))

        nothing = Viewpoints(
            position_m=np.zeros((0, 3)), yaw_rad=np.zeros(0), segment=np.zeros(0, dtype=np.int64)
        )
        unowned = np.full(len(left), -1)
        unseen = Views(np.zeros(1, dtype=np.int64), np.zeros(0, dtype=np.int32))
        stops = added(
            left,
            unowned,
            nothing,
            unseen,
            eyes_m,
            witness,
            _grid(live),
            self.camera,
            settings.pattern,
            fits,
        )
        start_m = travel_lengths(lattice, position_m[None], stops.position_m)[0]
        if len(stops) == 0 or not np.isfinite(start_m).all():
            return stops, list(range(len(stops)))
        order = path_from(start_m, travel_matrix(lattice, stops.position_m), settings.seed)
        return stops, [int(stop) for stop in order]


def _grid(live: DistanceField) -> Grid:
    return Grid(live.state, live.origin_m, live.voxel_size_m)

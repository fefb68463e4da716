"""Exploration in space: frontiers of the voxel map, places that show them, a tour over these.

A frontier cell was not seen, the body would fit there, and a free cell lies beside it (`volume.cells`).
Joined ones are cut into clusters about `cluster_m` long. Around each, places are sought where the body may
wait and from which the sensor, with the best yaw, would see most of its cells (`volume.views`): what a
level camera cannot see from below a shaft it sees from beside it, and only a way over cells that were
seen leads to a place, so no column is climbed that was not looked into before.

Exploring, the places are visited in the order of a short tour from the vehicle (`inspection.tour`, lengths
over free cells). With a target, the place goes first through which the way promises to be shortest: to
the place, to what it shows, and on to the target, unseen cells passable at `unseen_price` times their
length. When seen cells lead to the target, it is the goal.

A goal is kept until most of what it shows was seen. Cells that were looked at, or to whose place no plan
led, `looks` times are given up: so an exploration ends.

Source: frontiers Yamauchi 1997; viewpoints of clusters, tour and their upkeep after Zhou et al., FUEL,
RA-L 2021, and Zhang et al., FALCON, T-RO 2024; optimism D* Lite, Koenig and Likhachev 2002.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Annotated, ClassVar

import numpy as np

from uavexp.arrays import Bool, Float, Int
from uavexp.errors import require
from uavexp.explorer.aside import lie_aside
from uavexp.explorer.volume.cells import Body, Cells
from uavexp.explorer.volume.route import ANY, NARROWER, WIDE, Ways, optimistic
from uavexp.explorer.volume.space import Candidates, Space, leg_is_done
from uavexp.explorer.volume.steps import MOST_PRICE
from uavexp.explorer.volume.viewpoints import Cluster, Viewpoints
from uavexp.explorer.volume.views import Places, Sight
from uavexp.geometry import wrap_angle, yaw_of
from uavexp.parameters import (
    Count,
    NarrowClearance,
    NonNegative,
    Positive,
    Share,
    Unknown,
    above,
    at_most,
    between,
    option,
)
from uavexp.types import Goal, Limits, Observation

_ARRIVED_M, _ARRIVED_RAD, _DWELL_S = 0.35, 0.3, 0.5
_DETOUR_M = 3.0  # by which the way there may be longer than to the cluster's nearest place
_MOST_LEFT = 6  # times that the hysteresis is doubled: to a hundred metres
_SAME_M = 1.0  # a cluster whose place is so near to the goal goes on where the goal was


@dataclass(frozen=True, slots=True, kw_only=True)
class _Choice:
    """A place to go to, or the target, and the leg that leads there next."""

    place_m: Float  # (3,)
    yaw_rad: float  # NaN: none
    cells: Int  # (C,) that it is to show; none of the target
    is_target: bool
    score: float
    leg_m: Float  # (3,) where the leg ends
    made_s: float


@option
class Frontier3d:
    """Frontiers in space and a tour over them; see the module."""

    explores: ClassVar[bool] = True
    rate_hz: Positive = 5.0  # Hz, goal rate [ours]
    cell_m: Positive = 0.2  # m, edge of the cells in which the map is looked at [ours]
    min_clearance_m: Positive = 0.28  # m, of the places that are flown to and of ways there [ours]
    narrow_clearance_m: NarrowClearance = (
        0.22  # m, of ways where min_clearance_m leaves none; 0: never [ours]
    )
    min_cluster_cells: Count = 8  # fewer joined frontier cells are ignored [ours]
    cluster_m: Positive = 2.4  # m, edge of the cubes into which frontiers are cut [ours]
    horizontal_fov_deg: Annotated[float, above(0), at_most(360)] = 90.0  # deg, of the sensor; 180 and more:
    # a LiDAR
    lowest_deg: Annotated[float, between(-90, 90)] = -36.8  # deg, elevation of the lowest that it sees
    highest_deg: Annotated[float, between(-90, 90)] = 36.8  # deg, of the highest; sensor.mount_pitch_deg
    # moves both
    view_range_m: Positive = 4.5  # m, farther frontiers are not seen from a place [ours]
    unknown: Unknown = Unknown.OPTIMISTIC  # optimistic: with no frontier left, the target is flown to
    # through unknown space | conservative: it is not
    unseen_price: Annotated[float, between(1, MOST_PRICE)] = 1.5  # an unseen cell counts as so many seen
    # ones on the way to a target [ours]
    unseen_climb: Annotated[float, between(1, MOST_PRICE)] = 3.0  # times that, up or down: between storeys
    # there are floors; no cell counts as more than 5 [ours]
    covered_share: Share = 0.3  # a goal is left when so little of what it shows is still unseen [ours]
    rethink_s: Positive = 1.0  # s, a goal is compared with others after so long [ours]
    hysteresis_m: NonNegative = 1.5  # m, that another goal must be better; doubled by each goal that
    # was left for another since one was looked at [ours]
    turn_m: NonNegative = 1.5  # m, that turning back in flight, and half a turn of the yaw, count as [ours]
    look_m: NonNegative = 5.0  # m, so near to a place the yaw is that with which it shows most; before, the
    # way ahead is looked at [ours]
    looks: Annotated[int, between(1, 200)] = 2  # cells looked at so often in vain are given up [ours]
    aside_radius_m: Positive = 0.4  # m, places so near to one to which no plan led are set aside with it ...
    set_aside_s: NonNegative = 10.0  # s, ... for so long [ours]
    _limits: Limits | None = field(init=False, repr=False, default=None)
    _space: Space | None = field(init=False, repr=False, default=None)
    _choice: _Choice | None = field(init=False, repr=False, default=None)
    _aside: list[tuple[float, Float]] = field(init=False, repr=False, default_factory=list)
    _there_since_s: float = field(init=False, repr=False, default=math.inf)
    _left: int = field(init=False, repr=False, default=0)

    def __post_init__(self) -> None:
        low, high = self.lowest_deg, self.highest_deg
        require(low < high, f"highest_deg must be > lowest_deg = {low}, got {high}")
        require(
            self.horizontal_fov_deg >= 180.0 or high - low < 180.0,
            f"highest_deg must be < lowest_deg + 180 for a camera, got {high}",
        )

    def reset(self, flight_height_m: float, limits: Limits) -> None:
        """Begin a trial; heights are free, so the flight height counts for nothing."""
        del flight_height_m
        self._limits, self._space, self._choice = limits, None, None
        self._aside, self._there_since_s, self._left = [], math.inf, 0

    def reject(self, position_m: Float, time_s: float) -> None:
        """Set a place aside, and take a look off what it shows: no plan leads there."""
        self._aside.append((time_s + self.set_aside_s, position_m))
        if self._choice is not None and self._space is not None:
            self._space.cells.looked[self._choice.cells] += 1
        self._choice = None

    def select(self, observation: Observation, *, fresh: bool = False) -> Goal | None:
        """Return the goal; None when nothing that was seen leads to a place that shows anything more.

        With `fresh` a plan is about to be made, so all goals are compared.
        """
        now_s, here_m = observation.time_s, observation.state.position_m
        space = self._on(observation)
        self._aside = [entry for entry in self._aside if entry[0] > now_s]
        self._count_looks(space, observation)
        if self._choice is not None and not self._is_open(space, self._choice):
            self._choice, self._left = None, 0
        choice = self._choice
        age_s = math.inf if choice is None else now_s - choice.made_s
        if choice is not None and (age_s == 0.0 or not self._is_due(choice, age_s, here_m, fresh=fresh)):
            space.ways.measure()
        else:
            prices = optimistic(self.unseen_price, self.unseen_climb)
            space = self._space = space.updated(observation.target_m, prices)
            choice = self._choice = self._chosen(space, observation)
        return self._last_resort(observation) if choice is None else self._goal(choice, here_m)

    def _is_due(self, choice: _Choice, age_s: float, here_m: Float, *, fresh: bool) -> bool:
        """Whether all goals are to be compared again."""
        return fresh or age_s >= self.rethink_s - 1e-9 or leg_is_done(here_m, choice.leg_m, choice.place_m)

    def _goal(self, choice: _Choice, here_m: Float) -> Goal:
        """The end of the leg; near to the place, the yaw is that with which it shows most."""
        last = np.array_equal(choice.leg_m, choice.place_m)
        near = last and float(np.linalg.norm(choice.place_m - here_m)) <= self.look_m
        return Goal(
            position_m=choice.leg_m,
            is_target=choice.is_target and last,
            score=choice.score,
            yaw_rad=choice.yaw_rad if near else math.nan,
        )

    def _on(self, observation: Observation) -> Space:
        """What is kept of the map, as it was when a place was chosen last."""
        if self._space is None or self._space.cells.field is not observation.field:
            self._space, self._choice = self._begun(observation), None
        return self._space

    def _begun(self, observation: Observation) -> Space:
        """Nothing of this map is known yet."""
        if self._limits is None:
            raise RuntimeError("select() needs reset() first")
        map_, bounds_m, limits = observation.field, observation.flight_bounds_m, self._limits
        least_m = min(self.narrow_clearance_m or self.min_clearance_m, self.min_clearance_m)
        body = Body(self.min_clearance_m, least_m, limits.body_radius_m, 0.5 * limits.body_size_m[2])
        cells = Cells(map_, bounds_m, self.cell_m, body)
        places = Places(
            map_.state, map_.distance, map_.origin_m, map_.voxel_size_m, cells.cell_m,
            self.min_clearance_m, limits.body_radius_m, bounds_m[0], bounds_m[1],
        )  # fmt: skip
        width, low, high = map(math.radians, (self.horizontal_fov_deg, self.lowest_deg, self.highest_deg))
        sight = Sight(0.5 * width, low, high, self.view_range_m)
        most = max(1, round(self.cluster_m / cells.cell_m))
        return Space(
            cells=cells,
            viewpoints=Viewpoints(cells, sight, places, self.min_cluster_cells, most),
            ways=Ways(cells=cells, optimistic=optimistic(self.unseen_price, self.unseen_climb)),
            body=body,
        )

    def _count_looks(self, space: Space, observation: Observation) -> None:
        """After a while at the place, what it shows was looked at; a plan that ended elsewhere failed."""
        choice, now_s, state = self._choice, observation.time_s, observation.state
        if choice is None or choice.is_target:
            return
        turn = float(wrap_angle(choice.yaw_rad - yaw_of(state.quaternion_wxyz)))
        there = float(np.linalg.norm(choice.place_m - state.position_m)) <= _ARRIVED_M
        looks = there and not abs(turn) > _ARRIVED_RAD  # a sensor all around has no yaw
        short = float(np.linalg.norm(choice.leg_m - state.position_m)) > _ARRIVED_M
        flown, trajectory = observation.goal, observation.trajectory
        ended = trajectory is not None and flown is not None and now_s >= trajectory.end_s
        ended = ended and flown is not None and np.array_equal(flown.position_m, choice.leg_m)
        if not looks and not (ended and short):
            self._there_since_s = math.inf
            return
        self._there_since_s = min(self._there_since_s, now_s)
        if now_s - self._there_since_s < _DWELL_S - 1e-9:
            return
        self._there_since_s = math.inf
        if looks:
            space.cells.looked[choice.cells] += 1
            self._choice, self._left = None, 0
        else:
            self.reject(choice.leg_m, now_s)

    def _is_open(self, space: Space, choice: _Choice) -> bool:
        """Whether a choice still is one: not set aside, with much to show from a place that is one."""
        if self._aside_of(choice.place_m[None])[0]:
            return False
        if choice.is_target:
            return True
        wanted = space.cells.still_wanted(choice.cells) & (space.cells.looked[choice.cells] < self.looks)
        shows = len(wanted) > 0 and wanted.mean() > self.covered_share
        return bool(shows and space.viewpoints.is_place(choice.place_m))

    def _chosen(self, space: Space, observation: Observation) -> _Choice | None:
        """The target if seen cells lead there, else the best place; over worse ways if there is no other."""
        here_m, target_m = observation.state.position_m, observation.target_m
        clusters = space.viewpoints.clusters(self.looks, here_m)
        while True:
            for known in (WIDE, NARROWER, ANY):
                space.ways.begin(space.cell_of(here_m), known)
                to_target_m = space.to_target_m()
                leads = target_m is not None and math.isfinite(to_target_m)
                if target_m is not None and leads and not self._aside_of(target_m[None])[0]:
                    return self._bound_for(space, observation, target_m, -to_target_m)
                choice = self._best(space, observation, clusters)
                if choice is not None:
                    return choice
            if not clusters or not self._aside:
                return None
            self._aside.pop(0)  # what was set aside is tried again before all is given up

    def _bound_for(
        self, space: Space, observation: Observation, place_m: Float, score: float,
        shown: tuple[Int, float] | None = None,
    ) -> _Choice:  # fmt: skip
        """The choice of a place, with its cells and yaw, or of the target."""
        before = self._choice
        cells, yaw_rad = (np.zeros(0, np.int64), math.nan) if shown is None else shown
        return _Choice(
            place_m=place_m,
            yaw_rad=yaw_rad,
            cells=cells,
            is_target=shown is None,
            score=score,
            leg_m=space.leg_m(
                observation.state.position_m, place_m, None if before is None else before.leg_m
            ),
            made_s=observation.time_s,
        )

    def _last_resort(self, observation: Observation) -> Goal | None:
        """The target through unknown space when no frontier is left."""
        target_m = observation.target_m
        if target_m is None or self.unknown is Unknown.CONSERVATIVE or self._aside_of(target_m[None])[0]:
            return None
        return Goal(position_m=target_m, is_target=True, score=-math.inf)

    def _best(self, space: Space, observation: Observation, clusters: Sequence[Cluster]) -> _Choice | None:
        """The place to go to first."""
        kept = self._choice
        stay_m = self.hysteresis_m * 2.0 ** min(self._left, _MOST_LEFT)
        spare_m = stay_m + 2.0 * self.turn_m
        found = space.candidates(clusters, self._aside_of, spare_m)
        if not found.clusters:
            return None
        cost_m = found.there_m + self._turning_m(observation, found)
        going_on = np.zeros(len(cost_m), dtype=np.bool_)
        if kept is not None and not kept.is_target:
            going_on = np.linalg.norm(found.eyes_m - kept.place_m, axis=1) < _SAME_M
            cost_m = cost_m + stay_m * (going_on.any() & ~going_on)
        if space.ways.target is None:
            first = int(space.ways.tour(found.cells, np.maximum(cost_m, 0.0), found.there_m)[0])
        else:
            cost_m = cost_m + found.onward_m
            first = int(np.argmin(cost_m))
        if not math.isfinite(cost_m[first]):
            return None
        if (
            kept is not None
            and going_on[first]
            and space.leads_to(kept.place_m, found.there_m[first] + _DETOUR_M)
        ):
            place_m, shown = kept.place_m, (kept.cells, kept.yaw_rad)
        else:
            self._left += kept is not None
            place_m, shown = found.eyes_m[first], self._shown(space, found, first)
        return self._bound_for(space, observation, place_m, -float(cost_m[first]), shown)

    def _shown(self, space: Space, found: Candidates, first: int) -> tuple[Int, float]:
        """Cells that a place shows, and the yaw with which it does; NaN for a sensor all around."""
        cluster, eye_m = found.clusters[first], found.eyes_m[first]
        yaw_rad = float(cluster.yaws_rad[found.eye[first]])
        cells = space.viewpoints.shown(eye_m, yaw_rad, cluster.cells)
        return cells, math.nan if self.horizontal_fov_deg >= 360.0 else yaw_rad

    def _turning_m(self, observation: Observation, found: Candidates) -> Float:
        """What it costs (N,) to turn in flight towards places, and to the yaws with which they show most."""
        state = observation.state
        ahead = found.eyes_m - state.position_m
        speed, away = float(np.linalg.norm(state.velocity_mps)), np.linalg.norm(ahead, axis=1)
        cosine = ahead @ state.velocity_mps / np.maximum(speed * away, 1e-6)
        back = min(speed, 1.0) * 0.5 * (1.0 - cosine)
        if self.horizontal_fov_deg >= 360.0:
            return np.asarray(self.turn_m * back)
        yaws = [item.yaws_rad[n] for item, n in zip(found.clusters, found.eye, strict=True)]
        turn = np.abs(wrap_angle(np.array(yaws) - yaw_of(state.quaternion_wxyz))) / math.pi
        return np.asarray(self.turn_m * (back + turn))

    def _aside_of(self, points_m: Float) -> Bool:
        """Which points (N, 3) lie near a place set aside."""
        return lie_aside(points_m, self._aside, self.aside_radius_m)

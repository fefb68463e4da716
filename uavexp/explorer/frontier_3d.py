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
from dataclasses import dataclass, field, replace
from typing import Annotated, ClassVar

import numpy as np

from uavexp.arrays import Bool, Float, Int
from uavexp.errors import require
from uavexp.explorer.volume.cells import NARROW, OPEN, Cells
from uavexp.explorer.volume.route import ANY, WIDE, Ways, optimistic
from uavexp.explorer.volume.viewpoints import Cluster, Viewpoints
from uavexp.explorer.volume.views import Places, Sight
from uavexp.explorer.volume.waves import MOST_PRICE, Prices
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
_SAME_M = 1.0  # a cluster whose place is so near to the goal goes on where the goal was


@dataclass(frozen=True, slots=True, kw_only=True)
class _Choice:
    """A goal, and what it is to show."""

    goal: Goal
    cells: Int  # (C,) none of the target
    made_s: float


@dataclass(frozen=True, slots=True, kw_only=True)
class _Space:
    """What is kept of one map."""

    cells: Cells
    viewpoints: Viewpoints
    ways: Ways


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
    min_cluster_cells: Count = 4  # fewer joined frontier cells are ignored [ours]
    cluster_m: Positive = 1.6  # m, edge of the cubes into which frontiers are cut [ours]
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
    hysteresis_m: NonNegative = 1.5  # m, that another goal must be better [ours]
    turn_m: NonNegative = 1.5  # m, that turning back in flight counts as, at most [ours]
    look_m: NonNegative = 5.0  # m, so near to a place the yaw is that with which it shows most; before, the
    # way ahead is looked at [ours]
    looks: Annotated[int, between(1, 200)] = 3  # cells looked at so often in vain are given up [ours]
    aside_radius_m: Positive = 0.4  # m, places so near to one to which no plan led are set aside with it ...
    set_aside_s: NonNegative = 10.0  # s, ... for so long [ours]
    _limits: Limits | None = field(init=False, repr=False, default=None)
    _space: _Space | None = field(init=False, repr=False, default=None)
    _choice: _Choice | None = field(init=False, repr=False, default=None)
    _aside: list[tuple[float, Float]] = field(init=False, repr=False, default_factory=list)
    _there_since_s: float = field(init=False, repr=False, default=math.inf)

    def __post_init__(self) -> None:
        low, high = self.lowest_deg, self.highest_deg
        require(low < high, f"highest_deg must be > lowest_deg = {low}, got {high}")
        require(
            self.horizontal_fov_deg >= 180.0 or high - low < 180.0,
            f"highest_deg must be < lowest_deg + 180 for a camera, got {high}",
        )

    @property
    def _optimistic(self) -> Prices:
        """What ways to a target cost."""
        return optimistic(self.unseen_price, self.unseen_climb)

    def reset(self, flight_height_m: float, limits: Limits) -> None:
        """Begin a trial; heights are free, so the flight height counts for nothing."""
        del flight_height_m
        self._limits, self._space, self._choice = limits, None, None
        self._aside, self._there_since_s = [], math.inf

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
        now_s, space = observation.time_s, self._look(observation)
        self._aside = [entry for entry in self._aside if entry[0] > now_s]
        self._count_looks(space, observation)
        choice = self._choice
        if choice is not None and not self._is_open(space, choice):
            choice = self._choice = None
        if fresh or choice is None or now_s - choice.made_s >= self.rethink_s - 1e-9:
            self._choice = self._chosen(space, observation)
        if self._choice is None:
            return self._last_resort(observation)
        goal = self._choice.goal
        away_m = float(np.linalg.norm(goal.position_m - observation.state.position_m))
        return goal if away_m <= self.look_m else replace(goal, yaw_rad=math.nan)

    def _chosen(self, space: _Space, observation: Observation) -> _Choice | None:
        """The target if seen cells lead there, else the best place; over narrow ones if there is no other."""
        clusters = space.viewpoints.clusters(self.looks, observation.state.position_m)
        here = int(space.cells.of(observation.state.position_m[None])[0])
        for known in (WIDE, ANY):
            space.ways.begin(here, known)
            choice = self._target(space, observation) or self._best(space, observation, clusters)
            if choice is not None:
                return choice
        if not clusters or not self._aside:
            return None
        self._aside.pop(0)  # what was set aside is tried again before all is given up
        return self._chosen(space, observation)

    def _look(self, observation: Observation) -> _Space:
        """The map in cells, up to date."""
        space, target_m = self._space, observation.target_m
        if space is None or space.cells.field is not observation.field:
            space = self._begin(observation)
        changed = space.cells.update()
        target = None if target_m is None else int(space.cells.of(target_m[None])[0])
        if target != space.ways.target:
            ways = Ways(cells=space.cells, optimistic=self._optimistic, target=target)
            space = replace(space, ways=ways)
        else:
            space.ways.note(changed)
        self._space = space
        return space

    def _begin(self, observation: Observation) -> _Space:
        """Nothing of this map is known yet."""
        if self._limits is None:
            raise RuntimeError("select() needs reset() first")
        map_, bounds_m = observation.field, observation.flight_bounds_m
        least_m = min(self.narrow_clearance_m or self.min_clearance_m, self.min_clearance_m)
        cells = Cells(map_, bounds_m, self.cell_m, (self.min_clearance_m, least_m))
        places = Places(
            map_.state, map_.distance, map_.origin_m, map_.voxel_size_m, cells.cell_m,
            self.min_clearance_m, self._limits.body_radius_m, bounds_m[0], bounds_m[1],
        )  # fmt: skip
        width, low, high = map(math.radians, (self.horizontal_fov_deg, self.lowest_deg, self.highest_deg))
        sight = Sight(0.5 * width, low, high, self.view_range_m)
        most = max(1, round(self.cluster_m / cells.cell_m))
        self._choice = None
        return _Space(
            cells=cells,
            viewpoints=Viewpoints(cells, sight, places, self.min_cluster_cells, most),
            ways=Ways(cells=cells, optimistic=self._optimistic),
        )

    def _count_looks(self, space: _Space, observation: Observation) -> None:
        """After a while at the goal, what it shows was looked at; where a plan ended elsewhere, it failed."""
        choice, now_s, state = self._choice, observation.time_s, observation.state
        if choice is None or choice.goal.is_target:
            return
        away_m = float(np.linalg.norm(choice.goal.position_m - state.position_m))
        turn = float(wrap_angle(choice.goal.yaw_rad - yaw_of(state.quaternion_wxyz)))
        there = away_m <= _ARRIVED_M and not abs(turn) > _ARRIVED_RAD  # a sensor all around has no yaw
        trajectory = observation.trajectory
        ended = trajectory is not None and now_s >= max(trajectory.end_s, choice.made_s + _DWELL_S)
        if not there and not (ended and away_m > _ARRIVED_M):
            self._there_since_s = math.inf
            return
        self._there_since_s = min(self._there_since_s, now_s)
        if now_s - self._there_since_s < _DWELL_S - 1e-9:
            return
        if there:
            space.cells.looked[choice.cells] += 1
            self._choice = None
        else:
            self.reject(choice.goal.position_m, now_s)
        self._there_since_s = math.inf

    def _is_open(self, space: _Space, choice: _Choice) -> bool:
        """Whether a goal is still one: not set aside, and it has much to show from a place that is one."""
        if self._aside_of(choice.goal.position_m[None])[0]:
            return False
        if choice.goal.is_target:
            return True
        wanted = space.cells.wanted[choice.cells] & (space.cells.looked[choice.cells] < self.looks)
        much = wanted.mean() > self.covered_share
        return bool(much and space.viewpoints.is_place(choice.goal.position_m))

    def _target(self, space: _Space, observation: Observation) -> _Choice | None:
        """The mission's target, unless no free cells lead there."""
        target_m, cell = observation.target_m, space.ways.target
        if target_m is None or cell is None or self._aside_of(target_m[None])[0]:
            return None
        if space.cells.kind[cell] not in (OPEN, NARROW) or not math.isfinite(space.ways.there_m(cell)):
            return None
        goal = Goal(position_m=target_m, is_target=True, score=-space.ways.there_m(cell))
        return _Choice(goal=goal, cells=np.zeros(0, np.int64), made_s=observation.time_s)

    def _last_resort(self, observation: Observation) -> Goal | None:
        """The target through unknown space when no frontier is left."""
        target_m = observation.target_m
        if target_m is None or self.unknown is Unknown.CONSERVATIVE or self._aside_of(target_m[None])[0]:
            return None
        return Goal(position_m=target_m, is_target=True, score=-math.inf)

    def _best(self, space: _Space, observation: Observation, clusters: list[Cluster]) -> _Choice | None:
        """The place to go to first."""
        nearest = ((cluster, self._nearest_eye(space, cluster)) for cluster in clusters)
        found = [(cluster, *eye) for cluster, eye in nearest if eye is not None]
        if not found:
            return None
        eyes = np.array([eye for _, eye, _ in found])
        eyes_m = np.stack([cluster.eyes_m[eye] for cluster, eye, _ in found])
        there_m = np.array([there_m for _, _, there_m in found])
        cost_m = there_m + self._turning_m(observation, eyes_m)
        kept = self._choice
        if kept is not None:
            going_on = np.linalg.norm(eyes_m - kept.goal.position_m, axis=1) < _SAME_M
            cost_m = cost_m - self.hysteresis_m * going_on
        if space.ways.target is None:
            nodes = np.array([cluster.eyes[eye] for cluster, eye, _ in found])
            first = int(space.ways.tour(nodes, np.maximum(cost_m, 0.0), there_m)[0])
        else:
            cost_m = cost_m + np.array([self._onward_m(space, cluster, eye) for cluster, eye, _ in found])
            first = int(np.argmin(cost_m))
        if kept is not None and going_on[first]:
            return replace(kept, made_s=observation.time_s)
        if not math.isfinite(cost_m[first]):
            return None
        cluster, number = found[first][0], int(eyes[first])
        yaw_rad = math.nan if self.horizontal_fov_deg >= 360.0 else float(cluster.yaws_rad[number])
        shown = space.viewpoints.shown(cluster.eyes_m[number], float(cluster.yaws_rad[number]), cluster.cells)
        goal = Goal(
            position_m=cluster.eyes_m[number], is_target=False, score=-float(cost_m[first]), yaw_rad=yaw_rad
        )
        return _Choice(goal=goal, cells=shown, made_s=observation.time_s)

    def _nearest_eye(self, space: _Space, cluster: Cluster) -> tuple[int, float] | None:
        """Number of the place of a cluster that is nearest to the vehicle, and the way there, m."""
        free = np.flatnonzero(~self._aside_of(cluster.eyes_m))
        there_m = np.array([space.ways.there_m(int(cell)) for cell in cluster.eyes[free]])
        if not np.isfinite(there_m).any():
            return None
        return int(free[np.argmin(there_m)]), float(there_m.min())

    def _onward_m(self, space: _Space, cluster: Cluster, eye: int) -> float:
        """From a place to what it shows and on to the target."""
        middle_m = space.cells.centre_m(np.array([cluster.middle]))[0]
        return float(np.linalg.norm(middle_m - cluster.eyes_m[eye])) + space.ways.beyond_m(cluster.middle)

    def _turning_m(self, observation: Observation, points_m: Float) -> Float:
        """What it costs in flight to turn towards points (N, 3)."""
        velocity = observation.state.velocity_mps
        ahead = points_m - observation.state.position_m
        speed, away = float(np.linalg.norm(velocity)), np.linalg.norm(ahead, axis=1)
        cosine = ahead @ velocity / np.maximum(speed * away, 1e-6)
        return np.asarray(self.turn_m * min(speed, 1.0) * 0.5 * (1.0 - cosine))

    def _aside_of(self, points_m: Float) -> Bool:
        """Which points (N, 3) lie near a place set aside."""
        if not self._aside:
            return np.zeros(len(points_m), dtype=np.bool_)
        others = np.array([position_m for _, position_m in self._aside])
        away_m = np.linalg.norm(points_m[:, None] - others, axis=2)
        return np.asarray((away_m < self.aside_radius_m).any(axis=1))

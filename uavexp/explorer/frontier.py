"""Frontier exploration with the paper's scoring and a target term (paper 1, §3.3).

Frontier F = free cells of the planar map with an unknown 8-neighbour. Each cluster of F
gives one candidate: its centroid, moved up the distance field until the clearance is
enough. A candidate g is kept when d(g) > d_min and a path leads there (over known-free
cells; over unknown ones too, at `unknown_cost` times their length, when `unknown` is
optimistic), and is scored

    S(g) = alpha J_info(g) - beta J_cost(g) - gamma J_target(g)

J_info = unknown cells within `neighbourhood_m` of g; J_cost = length of the path to g, m;
J_target = length of the optimistic path (unknown is free) from g to the target, m. The
paper's score is gamma = 0; with beta = gamma the route through g that promises to be
shortest wins, information breaking ties. When the target itself is reachable over
known-free cells, the goal is the target.

Left to us by the paper, and [ours] here: splitting long clusters (the centroid of a long
curved frontier lies off it), setting visited or rejected goals aside, the target through
unknown space as last resort when no frontier is left, and persistence: a
goal is kept until it is nearer than `commit_m`, no longer reachable, or beaten by more
than `hysteresis`. Without it g* recedes with every scan, and "goal drift" means nothing.
"""

from __future__ import annotations

import math
from dataclasses import field
from enum import StrEnum
from typing import Annotated, ClassVar, TypeVar

import numpy as np

from uavexp.arrays import Bool, Float
from uavexp.errors import require
from uavexp.explorer.aside import lie_aside
from uavexp.explorer.planar import (
    ascend,
    cluster_centroids,
    connected_components,
    density_clusters,
    unknown_within,
)
from uavexp.explorer.view import KNOWN, Passage, Plane, prices, straight
from uavexp.mapping.projection import Band
from uavexp.parameters import Count, NarrowClearance, NonNegative, Positive, Unknown, Whole, between, option
from uavexp.types import Goal, Limits, Observation

Scalar = TypeVar("Scalar", float, Float)


class Clustering(StrEnum):
    """How frontier cells are grouped."""

    COMPONENTS = "components"
    DBSCAN = "dbscan"


@option
class Frontier:
    """Frontier goals; see the module docstring for the score."""

    explores: ClassVar[bool] = True
    rate_hz: Positive = 5.0  # Hz, goal rate [ours]
    alpha: NonNegative = 0.005  # m per unknown cell: weight of J_info [ours]
    beta: NonNegative = 1.0  # weight of the path length to the goal, J_cost [ours]
    gamma: NonNegative = 1.0  # weight of the optimistic path from goal to target [ours];
    # 0 is the paper's score
    neighbourhood_m: Positive = 1.0  # m, radius of N(g) in J_info [ours]
    clustering: Clustering = Clustering.COMPONENTS  # components | dbscan
    min_cluster_cells: Count = 5  # smaller frontier clusters are ignored [ours]
    max_cluster_m: Positive = 3.0  # m, longer clusters are split along their principal axis [ours]
    dbscan_radius_m: Positive = 0.3  # m, neighbourhood of dbscan
    dbscan_min_neighbours: Count = 3  # cells in it that make a core cell
    ascent_step_m: Positive = 0.1  # m, alpha_g of x <- x + alpha_g grad ESDF [ours]
    ascent_steps: Whole = 20  # at most so many ascent steps [ours]
    min_clearance_m: Positive = 0.3  # m, d_min of goals and of cells a path may use [ours]
    narrow_clearance_m: NarrowClearance = 0.22  # m, of cells, where min_clearance_m leaves no way; 0: never
    # [ours]
    enough_clearance_m: Positive = 0.6  # m, the ascent stops here [ours]
    cell_m: Positive = 0.15  # m, planar map
    occupied_below_m: Positive = 0.3  # m, planar map: a seen cell is occupied below this clearance,
    # else free [ours]
    unknown: Unknown = Unknown.OPTIMISTIC  # optimistic: paths to goals may cross unknown cells |
    # conservative: only known-free ones
    unknown_cost: Annotated[float, between(1, 5)] = 1.5  # an unknown cell counts as so many free ones
    # in J_cost [ours]
    band_below_m: NonNegative = 0.2  # m, planar map takes the least clearance from so far below the
    # flight height ...
    band_above_m: NonNegative = 0.2  # m, ... to so far above it [ours];
    # floor and ceiling stay out of the band
    min_distance_m: NonNegative = 0.8  # m, nearer frontiers are no goals:
    # the sensor cannot show more of them [ours]
    commit_m: NonNegative = 0.8  # m, a goal is kept until it is so near; then it counts as visited [ours]
    hysteresis: NonNegative = 2.0  # score by which another goal must win before that [ours]
    aside_radius_m: Positive = 0.3  # m, goals so near to a visited or rejected one are set
    # aside with it [ours]
    escape_m: Positive = 0.6  # m, so near to the vehicle d_min is not asked of a path:
    # it must find its way out [ours]
    set_aside_s: NonNegative = 10.0  # s, visited and unreachable goals are set aside for so long [ours]
    _height_m: float = field(init=False, repr=False, default=0.0)
    _current: Goal | None = field(init=False, repr=False, default=None)
    _aside: list[tuple[float, Float]] = field(init=False, repr=False, default_factory=list)
    _plane: Plane | None = field(init=False, repr=False, default=None)
    _passages: dict[float | str, Passage] = field(init=False, repr=False, default_factory=dict)
    # by clearance, or by what they are for

    def __post_init__(self) -> None:
        require(
            self.enough_clearance_m >= self.min_clearance_m,
            f"enough_clearance_m must be >= min_clearance_m = {self.min_clearance_m},"
            f" got {self.enough_clearance_m}",
        )

    def reset(self, flight_height_m: float, limits: Limits) -> None:
        """Begin a trial at this flight height."""
        self._height_m = flight_height_m
        self._current, self._plane = None, None
        self._aside, self._passages = [], {}

    def reject(self, position_m: Float, time_s: float) -> None:
        """Set goals around this position aside for `set_aside_s`."""
        self._aside.append((time_s + self.set_aside_s, position_m))
        self._current = None

    def select(self, observation: Observation, *, fresh: bool = False) -> Goal | None:
        """Return g*, or None when neither the target nor any frontier is reachable.

        With `fresh` the kept goal has no bonus: a plan is made anyway, so the best goal is taken.
        """
        now_s, bonus = observation.time_s, 0.0 if fresh else self.hysteresis
        self._aside = [entry for entry in self._aside if entry[0] > now_s]
        plane = self._look(observation)
        best, kept = self._choose(plane, observation, self.min_clearance_m, bonus)
        if best is None and kept is None:
            best = self._last_resort(observation)
        if best is None and kept is None:  # a doorway passed before it was mapped may look too narrow
            clearance_m = min(self.narrow_clearance_m or self.min_clearance_m, self.min_clearance_m)
            best, kept = self._choose(plane, observation, clearance_m, bonus)
        if kept is None or best is not None:
            self._current = best
        return self._current

    def _look(self, observation: Observation) -> Plane:
        """The plane, up to date with the map."""
        plane = self._plane
        if plane is None or plane.field is not observation.field:
            band = Band(
                z_min_m=self._height_m - self.band_below_m,
                z_max_m=self._height_m + self.band_above_m,
                flight_height_m=self._height_m,
                cell_m=self.cell_m,
                occupied_below_m=self.occupied_below_m,
            )
            plane = self._plane = Plane(observation.field, band, observation.flight_bounds_m)
            self._passages = {}
        parts = plane.update()
        for passage in self._passages.values():
            passage.note(parts)
        return plane

    def _passage(self, plane: Plane, observation: Observation, clearance_m: float) -> Passage:
        """The passage for a clearance, up to date."""
        passage, target_m = self._passages.get(clearance_m), observation.target_m
        target = None if target_m is None else plane.map.cell_of(target_m)
        if passage is None or passage.target != target:
            passage = Passage(plane=plane, clearance_m=clearance_m, escape_m=self.escape_m, target=target)
            self._passages[clearance_m] = passage
        passage.update(plane.map.cell_of(observation.state.position_m))
        return passage

    def _choose(
        self, plane: Plane, observation: Observation, clearance_m: float, bonus: float
    ) -> tuple[Goal | None, Goal | None]:
        """Best goal, and the kept one scored anew, over cells with more than this clearance.

        Beside a kept goal none is best but the target, or one that beats it by the bonus.
        """
        passage = self._passage(plane, observation, clearance_m)
        points_m = self._candidates(plane, observation)
        target = self._target(passage, observation)
        kept = self._kept(passage, observation, target)
        # Information is left out of `kept`: what that goal promised is being seen on the way.
        least = -math.inf if kept is None else kept.score + bonus
        return target or self._best(passage, points_m, least), kept

    def _last_resort(self, observation: Observation) -> Goal | None:
        """The target through unknown space when no frontier is left; the planner searches in 3D."""
        target_m = observation.target_m
        if target_m is None or self.unknown is Unknown.CONSERVATIVE or self._is_aside(target_m):
            return None
        return Goal(position_m=target_m, is_target=True, score=-math.inf)

    def _target(self, passage: Passage, observation: Observation) -> Goal | None:
        """The mission's target as a goal, None unless known-free cells lead there."""
        target_m, cell = observation.target_m, passage.target
        known = cell is not None and passage.knows_a_way(cell)
        optimistic = self.unknown is Unknown.OPTIMISTIC
        passage.begin(prices(self.unknown_cost, occupied=1.0) if optimistic else KNOWN)
        if not known or cell is None or target_m is None or self._is_aside(target_m):
            return None
        score = self._score(passage.from_vehicle(cell), 0.0)
        return Goal(position_m=target_m, is_target=True, score=score)

    def _kept(self, passage: Passage, observation: Observation, target: Goal | None) -> Goal | None:
        """Score the current goal anew; None when it is near, set aside or not reachable any more."""
        goal, position_m = self._current, observation.state.position_m
        if goal is None or goal.is_target:
            return target if goal is not None else None
        if float(np.linalg.norm(goal.position_m - position_m)) <= self.commit_m:
            # Visited. A frontier that is still there a few steps on cannot be seen from here.
            self._aside.append((observation.time_s + self.set_aside_s, goal.position_m))
        clearance_m = float(observation.field.distance_m(goal.position_m[None])[0])
        if self._is_aside(goal.position_m) or clearance_m <= self.min_clearance_m:
            return None
        cell = passage.plane.map.cell_of(goal.position_m)
        score = self._score(passage.from_vehicle(cell), passage.from_target(cell))
        if not math.isfinite(score):
            return None
        return Goal(position_m=goal.position_m, is_target=False, score=score)

    def _best(self, passage: Passage, points_m: Float, least: float) -> Goal | None:
        """The candidate with the highest score, the first of equals; None if all are below `least`.

        Ways are asked for in the order of the scores that straight ones would give, as long as
        these can still win, and no further than that.
        """
        plane, cell_m = passage.plane, self.cell_m
        cells = plane.cells_of(points_m)
        radius = self.neighbourhood_m / cell_m
        gain = self.alpha * unknown_within(plane.map.state, plane.inside, cells, radius)
        ahead = np.zeros(len(cells)) if passage.target is None else straight(cells, passage.target)
        bound = self._score(straight(cells, passage.vehicle), ahead) + gain
        best = -1
        for n in np.argsort(-bound, kind="stable"):
            if bound[n] < least:
                break
            cell, spare = (int(cells[n, 0]), int(cells[n, 1])), gain[n] - least
            there = passage.from_vehicle(
                cell, _most(spare - self.gamma * ahead[n] * cell_m, self.beta * cell_m)
            )
            if there == math.inf:
                continue
            beyond = passage.from_target(cell, _most(spare - self.beta * there * cell_m, self.gamma * cell_m))
            score = self._score(there, beyond) + gain[n]
            if math.isfinite(score) and (score > least or (score == least and not 0 <= best < n)):
                best, least = int(n), float(score)
        return Goal(position_m=points_m[best], is_target=False, score=least) if best >= 0 else None

    def _centroids(self, plane: Plane) -> Float:
        """Mean cell (N, 2) of each cluster of the frontier, or of its parts if it is long."""
        index = np.column_stack(np.divmod(np.flatnonzero(plane.frontier), plane.frontier.shape[1]))
        if self.clustering is Clustering.DBSCAN:
            cluster = density_clusters(index, self.dbscan_radius_m / self.cell_m, self.dbscan_min_neighbours)
        else:
            cluster = connected_components(plane.frontier, index)
        order = np.argsort(cluster, kind="stable")
        limit = self.max_cluster_m / self.cell_m
        return np.asarray(cluster_centroids(index[order], cluster[order], self.min_cluster_cells, limit))

    def _candidates(self, plane: Plane, observation: Observation) -> Float:
        """One point (N, 3) for each cluster, neither too near the vehicle nor set aside."""
        cells, map_ = self._centroids(plane), observation.field
        start_m = np.column_stack([plane.map.centre_m(cells), np.full(len(cells), self._height_m)])
        points_m: Float = ascend(
            map_.distance,
            map_.origin_m,
            map_.voxel_size_m,
            start_m,
            self.ascent_step_m,
            self.ascent_steps,
            self.enough_clearance_m,
            observation.flight_bounds_m,
        )
        far = np.linalg.norm(points_m - observation.state.position_m, axis=1) >= self.min_distance_m
        clear = map_.distance_m(points_m) > self.min_clearance_m
        return np.asarray(points_m[far & clear & ~self._aside_of(points_m)])

    def _score(self, there: Scalar, beyond: Scalar) -> Scalar:
        """Score of ways to goals and on to the target, in cells, without what the goals promise to show."""
        return -self.beta * (there * self.cell_m) - self.gamma * (beyond * self.cell_m)

    def _is_aside(self, point_m: Float) -> bool:
        return bool(self._aside_of(point_m[None])[0])

    def _aside_of(self, points_m: Float) -> Bool:
        """Which points (N, 3) lie near a goal set aside."""
        return lie_aside(points_m, self._aside, self.aside_radius_m)


def _most(spare: float, weight: float) -> float:
    """The largest cost that can be paid."""
    return spare / weight if weight > 0.0 else math.inf

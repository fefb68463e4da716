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
from typing import Annotated, ClassVar

import numpy as np

from uavexp.arrays import Bool, Float, Int32
from uavexp.errors import require
from uavexp.explorer.planar import (
    ascend,
    connected_components,
    density_clusters,
    frontier_cells,
    split_centroids,
    unknown_within,
)
from uavexp.explorer.view import Search, View, view_of
from uavexp.mapping.projection import project
from uavexp.parameters import Count, NonNegative, Positive, Unknown, Whole, between, option
from uavexp.types import Goal, Limits, Observation


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
    _body_radius_m: float = field(init=False, repr=False, default=0.0)
    _current: Goal | None = field(init=False, repr=False, default=None)
    _aside: list[tuple[float, Float]] = field(init=False, repr=False, default_factory=list)

    def __post_init__(self) -> None:
        require(
            self.enough_clearance_m >= self.min_clearance_m,
            f"enough_clearance_m must be >= min_clearance_m = {self.min_clearance_m},"
            f" got {self.enough_clearance_m}",
        )

    def reset(self, flight_height_m: float, limits: Limits) -> None:
        """Begin a trial at this flight height."""
        self._height_m = flight_height_m
        self._body_radius_m = limits.body_radius_m
        self._current = None
        self._aside = []

    def reject(self, position_m: Float, time_s: float) -> None:
        """Set goals around this position aside for `set_aside_s`."""
        self._aside.append((time_s + self.set_aside_s, position_m))
        self._current = None

    def select(self, observation: Observation, *, fresh: bool = False) -> Goal | None:
        """Return g*, or None when neither the target nor any frontier is reachable.

        With `fresh` the kept goal has no bonus: a plan is made anyway, so the best goal is taken.
        """
        now_s = observation.time_s
        self._aside = [entry for entry in self._aside if entry[0] > now_s]
        best, kept = self._choose(observation, self.min_clearance_m)
        if best is None and kept is None:
            best = self._last_resort(observation)
        if best is None and kept is None:  # a doorway passed before it was mapped may look too narrow
            best, kept = self._choose(observation, min(self._body_radius_m, self.min_clearance_m))
        bonus = 0.0 if fresh else self.hysteresis
        # Information is left out of `kept`: what that goal promised is being seen on the way.
        if kept is None or (best is not None and (best.is_target or best.score >= kept.score + bonus)):
            self._current = best
        return self._current

    def _choose(self, observation: Observation, clearance_m: float) -> tuple[Goal | None, Goal | None]:
        """Best goal, and the kept one scored anew, over cells with more than this clearance."""
        view = self._view(observation, clearance_m)
        points_m = self._candidates(view, observation)
        search = self._search(view, observation, points_m)
        best = self._target(search, observation) or self._best(search, points_m)
        return best, self._kept(search, observation)

    def _last_resort(self, observation: Observation) -> Goal | None:
        """The target through unknown space when no frontier is left; the planner searches in 3D."""
        target_m = observation.target_m
        if target_m is None or self.unknown is Unknown.CONSERVATIVE or self._is_aside(target_m):
            return None
        return Goal(position_m=target_m, is_target=True, score=-math.inf)

    def _kept(self, search: Search, observation: Observation) -> Goal | None:
        """Score the current goal anew; None when it is near, set aside or not reachable any more."""
        goal, position_m = self._current, observation.state.position_m
        if goal is None:
            return None
        distance_m = float(np.linalg.norm(goal.position_m - position_m))
        if goal.is_target:
            return self._target(search, observation)
        if distance_m <= self.commit_m:
            # Visited. A frontier that is still there a few steps on cannot be seen from here.
            self._aside.append((observation.time_s + self.set_aside_s, goal.position_m))
        if self._is_aside(goal.position_m):
            return None
        clearance_m = float(observation.field.distance_m(goal.position_m[None])[0])
        score = float(self._scores(search, goal.position_m[None])[0])
        if clearance_m <= self.min_clearance_m or not math.isfinite(score):
            return None
        return Goal(position_m=goal.position_m, is_target=False, score=score)

    def _view(self, observation: Observation, clearance_m: float) -> View:
        planar = project(
            observation.field,
            z_min_m=self._height_m - self.band_below_m,
            z_max_m=self._height_m + self.band_above_m,
            flight_height_m=self._height_m,
            cell_m=self.cell_m,
            occupied_below_m=self.occupied_below_m,
        )
        position_m, bounds_m = observation.state.position_m, observation.flight_bounds_m
        return view_of(planar, position_m, bounds_m, clearance_m, self.escape_m)

    def _search(self, view: View, observation: Observation, points_m: Float) -> Search:
        """Path lengths to and from everything that will be scored: candidates, kept goal, target."""
        target_m = observation.target_m
        kept_m = self._current.position_m[None] if self._current is not None else np.zeros((0, 3))
        wanted = view.flat(np.concatenate([points_m, kept_m]))
        known = view.known
        passable = view.clear if self.unknown is Unknown.OPTIMISTIC else known
        if target_m is None:
            from_vehicle = view.lengths(passable, view.vehicle, wanted, self.unknown_cost)
            return Search(view, from_vehicle, np.zeros_like(from_vehicle), False)
        target, target_flat = view.planar.cell_of(target_m), view.flat(target_m[None])
        target_known = bool(known[target]) and bool(
            np.isfinite(view.lengths(known, view.vehicle, target_flat, 1.0)[target])
        )
        from_target = view.lengths(view.clear, target, wanted, 1.0)
        if target_known:  # only then can it be the goal, and its cost matters
            wanted = np.concatenate([wanted, target_flat])
        from_vehicle = view.lengths(passable, view.vehicle, wanted, self.unknown_cost)
        return Search(view, from_vehicle, from_target, target_known)

    def _target(self, search: Search, observation: Observation) -> Goal | None:
        """The mission's target as a goal, None unless known-free cells lead there."""
        target_m = observation.target_m
        if target_m is None or not search.target_known or self._is_aside(target_m):
            return None
        planar = search.view.planar
        cost_m = float(search.from_vehicle[planar.cell_of(target_m)]) * planar.cell_m
        return Goal(position_m=target_m, is_target=True, score=-self.beta * cost_m)

    def _best(self, search: Search, points_m: Float) -> Goal | None:
        """The candidate with the highest score, the first of equals."""
        scores = self._scores(search, points_m)
        points_m, scores = points_m[np.isfinite(scores)], scores[np.isfinite(scores)]
        if len(points_m) == 0:
            return None
        scores = scores + self.alpha * self._information(search.view, points_m)
        best = int(np.argmax(scores))
        return Goal(position_m=points_m[best], is_target=False, score=float(scores[best]))

    def _clusters(self, view: View) -> list[Int32]:
        cells = frontier_cells(view.planar.state, view.inside)
        if self.clustering is Clustering.DBSCAN:
            clusters = density_clusters(cells, self.dbscan_radius_m / self.cell_m, self.dbscan_min_neighbours)
        else:
            clusters = connected_components(cells)
        return [cluster for cluster in clusters if len(cluster) >= self.min_cluster_cells]

    def _candidates(self, view: View, observation: Observation) -> Float:
        """One point (N, 3) for each cluster, neither too near the vehicle nor set aside."""
        clusters = self._clusters(view)
        if not clusters:
            return np.zeros((0, 3))
        limit = self.max_cluster_m / self.cell_m
        cells = np.concatenate([split_centroids(cluster, limit) for cluster in clusters])
        start_m = np.column_stack([view.planar.centre_m(cells), np.full(len(cells), self._height_m)])
        map_ = observation.field
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

    def _scores(self, search: Search, points_m: Float) -> Float:
        """Score (N,) of points (N, 3) without what they promise to show; -inf: no way there."""
        view = search.view
        flat = view.flat(points_m)
        cost_m = search.from_vehicle.ravel()[flat].astype(np.float64) * view.planar.cell_m
        to_target_m = search.from_target.ravel()[flat].astype(np.float64) * view.planar.cell_m
        return np.asarray(-self.beta * cost_m - self.gamma * to_target_m)

    def _information(self, view: View, points_m: Float) -> Float:
        """J_info (N,): unknown cells around each point (N, 3)."""
        radius = self.neighbourhood_m / self.cell_m
        return np.asarray(unknown_within(view.planar.state, view.inside, view.flat(points_m), radius))

    def _is_aside(self, point_m: Float) -> bool:
        return bool(self._aside_of(point_m[None])[0])

    def _aside_of(self, points_m: Float) -> Bool:
        """Which points (N, 3) lie near a goal set aside."""
        if not self._aside:
            return np.zeros(len(points_m), dtype=np.bool_)
        others = np.array([position_m for _, position_m in self._aside])
        away_m = np.linalg.norm(points_m[:, None] - others, axis=2)
        return np.asarray((away_m < self.aside_radius_m).any(axis=1))

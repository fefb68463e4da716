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
from dataclasses import dataclass, field
from enum import StrEnum

import numpy as np

from uavexp.errors import require, require_non_negative, require_option, require_positive
from uavexp.explorer.planar import (
    FREE,
    UNKNOWN,
    connected_components,
    density_clusters,
    frontier_cells,
    path_lengths,
    split_long,
    unknown_within,
)
from uavexp.mapping.base import DistanceField
from uavexp.mapping.projection import PlanarMap, project
from uavexp.types import Bool, Float, Float32, Goal, Limits, Observation


class Unknown(StrEnum):
    """Whether a path to a goal may cross unknown cells."""

    OPTIMISTIC = "optimistic"
    CONSERVATIVE = "conservative"


class Clustering(StrEnum):
    """How frontier cells are grouped."""

    COMPONENTS = "components"
    DBSCAN = "dbscan"


@dataclass(frozen=True, slots=True)
class _Search:
    """Graph distances on one planar map, from the vehicle and from the target."""

    planar: PlanarMap
    inside: Bool  # (X, Y) cells within the flight bounds
    from_vehicle: Float32  # (X, Y) path cost from the vehicle, over unknown cells too if optimistic
    from_target: Float32 | None  # (X, Y) with unknown as free, in cells
    target_known: bool  # whether known-free cells lead from the vehicle to the target

    def cost_m(self, cell: tuple[int, int]) -> float:
        return float(self.from_vehicle[cell]) * self.planar.cell_m

    def to_target_m(self, cell: tuple[int, int]) -> float:
        return 0.0 if self.from_target is None else float(self.from_target[cell]) * self.planar.cell_m


@dataclass(slots=True, kw_only=True)
class Frontier:
    """Frontier goals; see the module docstring for the score."""

    rate_hz: float = 5.0
    alpha: float = 0.005  # m per unknown cell
    beta: float = 1.0
    gamma: float = 1.0
    neighbourhood_m: float = 1.0
    clustering: Clustering = Clustering.COMPONENTS
    min_cluster_cells: int = 5
    max_cluster_m: float = 3.0
    dbscan_radius_m: float = 0.3
    dbscan_min_neighbours: int = 3
    ascent_step_m: float = 0.1  # alpha_g
    ascent_steps: int = 20
    min_clearance_m: float = 0.3  # d_min
    enough_clearance_m: float = 0.6
    cell_m: float = 0.15
    occupied_below_m: float = 0.3
    unknown: Unknown = Unknown.OPTIMISTIC
    unknown_cost: float = 1.5
    band_below_m: float = 0.2
    band_above_m: float = 0.2
    min_distance_m: float = 0.8
    commit_m: float = 0.8
    hysteresis: float = 2.0
    aside_radius_m: float = 0.3
    escape_m: float = 0.6
    set_aside_s: float = 10.0
    _height_m: float = field(init=False, repr=False, default=0.0)
    _current: Goal | None = field(init=False, repr=False, default=None)
    _aside: list[tuple[float, Float]] = field(init=False, repr=False, default_factory=list)

    def __post_init__(self) -> None:
        self.clustering = require_option("clustering", self.clustering, Clustering)
        self.unknown = require_option("unknown", self.unknown, Unknown)
        require(1.0 <= self.unknown_cost <= 5.0, f"unknown_cost must be 1 to 5, got {self.unknown_cost}")
        require_positive(
            rate_hz=self.rate_hz,
            neighbourhood_m=self.neighbourhood_m,
            max_cluster_m=self.max_cluster_m,
            dbscan_radius_m=self.dbscan_radius_m,
            ascent_step_m=self.ascent_step_m,
            min_clearance_m=self.min_clearance_m,
            cell_m=self.cell_m,
            occupied_below_m=self.occupied_below_m,
            aside_radius_m=self.aside_radius_m,
            escape_m=self.escape_m,
        )
        require_non_negative(
            alpha=self.alpha,
            beta=self.beta,
            gamma=self.gamma,
            band_below_m=self.band_below_m,
            band_above_m=self.band_above_m,
            min_distance_m=self.min_distance_m,
            commit_m=self.commit_m,
            hysteresis=self.hysteresis,
            set_aside_s=self.set_aside_s,
            ascent_steps=self.ascent_steps,
        )
        require(self.min_cluster_cells >= 1, f"min_cluster_cells must be >= 1, got {self.min_cluster_cells}")
        require(
            self.enough_clearance_m >= self.min_clearance_m,
            f"enough_clearance_m must be >= min_clearance_m = {self.min_clearance_m},"
            f" got {self.enough_clearance_m}",
        )

    def reset(self, flight_height_m: float, limits: Limits) -> None:
        """Begin a trial at this flight height."""
        self._height_m = flight_height_m
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
        search = self._search(observation)
        best = self._target(search, observation) or self._best_candidate(search, observation)
        kept = self._kept(search, observation)
        bonus = 0.0 if fresh else self.hysteresis
        # Information is left out of `kept`: what that goal promised is being seen on the way.
        if kept is None or (best is not None and (best.is_target or best.score >= kept.score + bonus)):
            self._current = best or self._last_resort(observation)
        return self._current

    def _last_resort(self, observation: Observation) -> Goal | None:
        """The target through unknown space when no frontier is left; the planner searches in 3D."""
        target_m = observation.target_m
        if target_m is None or self.unknown is Unknown.CONSERVATIVE or self._is_aside(target_m):
            return None
        return Goal(position_m=target_m, is_target=True, score=-math.inf)

    def _kept(self, search: _Search, observation: Observation) -> Goal | None:
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
        return self._score(search, goal.position_m, observation.field)

    def _search(self, observation: Observation) -> _Search:
        planar = project(
            observation.field,
            z_min_m=self._height_m - self.band_below_m,
            z_max_m=self._height_m + self.band_above_m,
            flight_height_m=self._height_m,
            cell_m=self.cell_m,
            occupied_below_m=self.occupied_below_m,
        )
        inside = _inside(planar, observation.flight_bounds_m)
        clear = inside & (planar.clearance > self.min_clearance_m)
        unit = np.full(planar.state.shape, 100, dtype=np.int32)
        vehicle = planar.cell_of(observation.state.position_m)
        # Nearer to an obstacle than d_min, the vehicle must still find its way out.
        clear |= inside & (planar.clearance > 0.0) & _within(planar, vehicle, self.escape_m)
        known = clear & (planar.state == FREE)
        if self.unknown is Unknown.OPTIMISTIC:
            dear = np.int32(round(100 * self.unknown_cost))
            cost = np.where(planar.state == UNKNOWN, dear, unit)
            from_vehicle = path_lengths(clear, cost, vehicle)
        else:
            from_vehicle = path_lengths(known, unit, vehicle)
        if observation.target_m is None:
            return _Search(planar, inside, from_vehicle, None, False)
        target = planar.cell_of(observation.target_m)
        target_known = bool(known[target]) and bool(np.isfinite(path_lengths(known, unit, vehicle)[target]))
        return _Search(planar, inside, from_vehicle, path_lengths(clear, unit, target), target_known)

    def _target(self, search: _Search, observation: Observation) -> Goal | None:
        """The mission's target as a goal, None unless known-free cells lead there."""
        target_m = observation.target_m
        if target_m is None or not search.target_known or self._is_aside(target_m):
            return None
        cost_m = search.cost_m(search.planar.cell_of(target_m))
        return Goal(position_m=target_m, is_target=True, score=-self.beta * cost_m)

    def _best_candidate(self, search: _Search, observation: Observation) -> Goal | None:
        candidates = [
            goal
            for cluster in self._clusters(search)
            if (goal := self._candidate(search, cluster, observation)) is not None
        ]
        return max(candidates, key=lambda goal: goal.score, default=None)

    def _clusters(self, search: _Search) -> list[np.ndarray]:
        cells = frontier_cells(search.planar.state, search.inside)
        if self.clustering is Clustering.DBSCAN:
            clusters = density_clusters(cells, self.dbscan_radius_m / self.cell_m, self.dbscan_min_neighbours)
        else:
            clusters = connected_components(cells)
        limit = self.max_cluster_m / self.cell_m
        return [
            part
            for cluster in clusters
            if len(cluster) >= self.min_cluster_cells
            for part in split_long(cluster, limit)
        ]

    def _candidate(self, search: _Search, cluster: np.ndarray, observation: Observation) -> Goal | None:
        centroid = search.planar.centre_m(cluster.mean(axis=0))
        point = np.append(centroid, self._height_m)
        point = self._ascend(point, observation.field, observation.flight_bounds_m)
        if np.linalg.norm(point - observation.state.position_m) < self.min_distance_m:
            return None
        return None if self._is_aside(point) else self._score(search, point, observation.field, info=True)

    def _ascend(self, point_m: Float, distance: DistanceField, bounds_m: Float) -> Float:
        """X <- x + alpha_g grad ESDF(x) in the plane until the clearance is enough."""
        for _ in range(self.ascent_steps):
            if distance.distance_m(point_m[None])[0] >= self.enough_clearance_m:
                break
            gradient = distance.gradient(point_m[None])[0]
            norm = math.hypot(gradient[0], gradient[1])
            if norm < 1e-3:
                break
            moved = point_m.copy()
            moved[:2] += self.ascent_step_m * gradient[:2] / norm
            point_m = np.clip(moved, bounds_m[0], bounds_m[1])
        point_m[2] = self._height_m
        return point_m

    def _score(
        self, search: _Search, point_m: Float, distance: DistanceField, info: bool = False
    ) -> Goal | None:
        """Score one goal, None when it is too close to an obstacle or not reachable."""
        cell = search.planar.cell_of(point_m)
        cost_m, to_target_m = search.cost_m(cell), search.to_target_m(cell)
        if not (math.isfinite(cost_m) and math.isfinite(to_target_m)):
            return None
        if distance.distance_m(point_m[None])[0] <= self.min_clearance_m:
            return None
        score = -self.beta * cost_m - self.gamma * to_target_m
        if info:
            radius = self.neighbourhood_m / self.cell_m
            score += self.alpha * unknown_within(search.planar.state, search.inside, cell, radius)
        return Goal(position_m=point_m, is_target=False, score=score)

    def _is_aside(self, point_m: Float) -> bool:
        return any(float(np.linalg.norm(point_m - other)) < self.aside_radius_m for _, other in self._aside)


def _inside(planar: PlanarMap, bounds_m: Float) -> Bool:
    nx, ny = planar.state.shape
    x = planar.origin_m[0] + (np.arange(nx) + 0.5) * planar.cell_m
    y = planar.origin_m[1] + (np.arange(ny) + 0.5) * planar.cell_m
    within_x = (x >= bounds_m[0, 0]) & (x <= bounds_m[1, 0])
    within_y = (y >= bounds_m[0, 1]) & (y <= bounds_m[1, 1])
    inside: Bool = within_x[:, None] & within_y[None, :]
    return inside


def _within(planar: PlanarMap, cell: tuple[int, int], radius_m: float) -> Bool:
    i, j = np.ogrid[: planar.state.shape[0], : planar.state.shape[1]]
    near: Bool = (i - cell[0]) ** 2 + (j - cell[1]) ** 2 <= (radius_m / planar.cell_m) ** 2
    return near

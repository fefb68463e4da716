"""What is kept of one map: its cells, the clusters of its frontier, and the ways between places."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from uavexp.arrays import Bool, Float, Int
from uavexp.explorer.volume.cells import NARROW, OPEN, Body, Cells
from uavexp.explorer.volume.legs import is_straight, next_leg
from uavexp.explorer.volume.route import PLACES, Ways
from uavexp.explorer.volume.steps import Prices
from uavexp.explorer.volume.viewpoints import Cluster, Viewpoints

_LEAST_LEG_M = 0.8
_LEG_DONE_M = 1.2  # so near to the end of a leg the next one is flown to, before the vehicle brakes


class Candidates(NamedTuple):
    """Places that can be reached, the nearest of each cluster."""

    clusters: Sequence[Cluster]  # (N,)
    eye: Int  # (N,) number of the place among its cluster's
    eyes_m: Float  # (N, 3)
    there_m: Float  # (N,) length of the way there
    onward_m: Float  # (N,) to what it shows, and on to the target; 0 without one

    @property
    def cells(self) -> Int:
        """Cells (N,) of the places."""
        return np.array([cluster.eyes[n] for cluster, n in zip(self.clusters, self.eye, strict=True)])


@dataclass(frozen=True, slots=True, kw_only=True)
class Space:
    """Cells, clusters and ways on one map."""

    cells: Cells
    viewpoints: Viewpoints
    ways: Ways
    body: Body

    def updated(self, target_m: Float | None, prices: Prices) -> Space:
        """The same, brought up to date, with ways to this target at these prices."""
        changed = self.cells.update()
        target = None if target_m is None else self.cell_of(target_m)
        if target != self.ways.target:
            return replace(self, ways=Ways(cells=self.cells, optimistic=prices, target=target))
        self.ways.note(changed)
        return self

    def cell_of(self, point_m: Float) -> int:
        """The cell that holds a point (3,)."""
        return int(self.cells.of(point_m[None])[0])

    def to_target_m(self) -> float:
        """Length of the way over seen cells to the target; inf without one or the other."""
        cell = self.ways.target
        if cell is None or self.cells.kind[cell] not in (OPEN, NARROW):
            return np.inf
        return float(self.ways.there_m(np.array([cell]))[0])

    def candidates(
        self, clusters: Sequence[Cluster], is_aside: Callable[[Float], Bool], spare_m: float
    ) -> Candidates:
        """The nearest place of each cluster that has one which is not set aside and can be reached.

        Clusters of which none can be better than the best, or worse by less than `spare_m`, are left out;
        without a target, those beyond what is enough for a tour.
        """
        seen = [cluster for cluster in clusters if len(cluster.eyes)]
        counts = [len(cluster.eyes) for cluster in seen]
        group, onward_m = np.repeat(np.arange(len(seen)), counts), self._onward_m(seen)
        eyes_m = np.concatenate([np.zeros((0, 3)), *(cluster.eyes_m for cluster in seen)])
        open_ = ~is_aside(eyes_m) & np.isfinite(onward_m)[group]
        there_m = np.full(len(group), np.inf)
        if open_.any():
            places = np.concatenate([cluster.eyes for cluster in seen])[open_]
            tours, waiting = self.ways.target is None, len(np.unique(group[open_]))
            there_m[open_] = self.ways.nearest_m(
                places, group[open_], onward_m[group[open_]], min(PLACES, waiting) if tours else waiting,
                np.inf if tours else spare_m,
            )  # fmt: skip
        parts = np.split(there_m, np.cumsum(counts)[:-1]) if seen else []
        found = [n for n, part in enumerate(parts) if np.isfinite(part.min())]
        eye = [int(np.argmin(parts[n])) for n in found]
        return Candidates(
            [seen[n] for n in found],
            np.array(eye, dtype=np.int64),
            np.array([seen[n].eyes_m[e] for n, e in zip(found, eye, strict=True)]).reshape(-1, 3),
            np.array([parts[n].min() for n in found]),
            onward_m[found],
        )

    def _onward_m(self, clusters: Sequence[Cluster]) -> Float:
        """Length (N,) from the first place of clusters to what it shows and on to the target."""
        if self.ways.target is None or not clusters:
            return np.zeros(len(clusters))
        middle = np.array([cluster.middle for cluster in clusters])
        first_m = np.stack([cluster.eyes_m[0] for cluster in clusters])
        look_m = np.linalg.norm(self.cells.centre_m(middle) - first_m, axis=1)
        return np.asarray(look_m + self.ways.beyond_m(middle))

    def leads_to(self, place_m: Float, most_m: float) -> bool:
        """Whether a way over what was seen leads to a place (3,), no longer than that."""
        return bool(np.isfinite(self.ways.there_m(np.array([self.cell_of(place_m)]), most_m)[0]))

    def leg_m(self, from_m: Float, to_m: Float, before_m: Float | None) -> Float:
        """Where (3,) the next leg to a place ends; the one before, while it holds."""
        field = self.cells.field
        if is_straight(field, self.body, from_m, to_m):
            return to_m
        if (
            before_m is not None
            and np.linalg.norm(before_m - from_m) > _LEG_DONE_M
            and is_straight(field, self.body, from_m, before_m)
        ):
            return before_m
        way_m = np.concatenate([self.cells.clearest_m(self.ways.way(self.cell_of(to_m))[1:-1]), to_m[None]])
        return np.asarray(way_m[next_leg(field, self.body, from_m, way_m, _LEAST_LEG_M)])


def leg_is_done(from_m: Float, leg_m: Float, to_m: Float) -> bool:
    """Whether the vehicle comes to the end of a leg that is not the end of the way."""
    return not np.array_equal(leg_m, to_m) and bool(np.linalg.norm(leg_m - from_m) <= _LEG_DONE_M)

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
from uavexp.explorer.volume.viewpoints import Cluster, Viewpoints
from uavexp.explorer.volume.waves import Prices

_LEAST_LEG_M = 0.8
_AT_ONCE = 8  # clusters that are asked for at once
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
        self, clusters: Sequence[Cluster], is_aside: Callable[[Float], Bool], here_m: Float, spare_m: float
    ) -> Candidates:
        """The nearest place of each cluster that has one which is not set aside and can be reached.

        Clusters are asked in the order of straight ways, as long as one may still be the best, or better
        than that by less than `spare_m`; without a target, until there are enough for a tour.
        """
        seen = [cluster for cluster in clusters if len(cluster.eyes)]
        onward_m = self._onward_m(seen)
        straight_m = np.array([np.linalg.norm(item.eyes_m - here_m, axis=1).min() for item in seen])
        order = np.argsort(straight_m + onward_m, kind="stable")
        found: list[tuple[Cluster, int, float, float]] = []
        best_m = np.inf
        for begin in range(0, len(order), _AT_ONCE):
            group = order[begin : begin + _AT_ONCE]
            enough = len(found) >= PLACES if self.ways.target is None else False
            if enough or straight_m[group[0]] + onward_m[group[0]] > best_m + spare_m:
                break
            for n, eye, there_m in self._nearest([seen[n] for n in group], is_aside):
                found.append((seen[group[n]], eye, there_m, onward_m[group[n]]))
                best_m = min(best_m, there_m + onward_m[group[n]]) if self.ways.target is not None else best_m
        return Candidates(
            [item[0] for item in found],
            np.array([item[1] for item in found], dtype=np.int64),
            np.array([item[0].eyes_m[item[1]] for item in found]).reshape(-1, 3),
            np.array([item[2] for item in found]),
            np.array([item[3] for item in found]),
        )

    def _nearest(
        self, clusters: Sequence[Cluster], is_aside: Callable[[Float], Bool]
    ) -> list[tuple[int, int, float]]:
        """Of clusters that have a place within reach: number, place and length of the way there."""
        lengths_m = self.ways.there_m(np.concatenate([cluster.eyes for cluster in clusters]))
        aside = is_aside(np.concatenate([cluster.eyes_m for cluster in clusters]))
        ends = np.cumsum([len(cluster.eyes) for cluster in clusters])[:-1]
        parts = np.split(np.where(aside, np.inf, lengths_m), ends)
        nearest = [(n, int(np.argmin(part)), float(part.min())) for n, part in enumerate(parts)]
        return [item for item in nearest if np.isfinite(item[2])]

    def _onward_m(self, clusters: Sequence[Cluster]) -> Float:
        """Length (N,) from the first place of clusters to what it shows and on to the target."""
        if self.ways.target is None or not clusters:
            return np.zeros(len(clusters))
        middle = np.array([cluster.middle for cluster in clusters])
        first_m = np.stack([cluster.eyes_m[0] for cluster in clusters])
        look_m = np.linalg.norm(self.cells.centre_m(middle) - first_m, axis=1)
        return np.asarray(look_m + self.ways.beyond_m(middle))

    def leads_to(self, place_m: Float) -> bool:
        """Whether a way over what was seen leads to a place (3,)."""
        return bool(np.isfinite(self.ways.there_m(np.array([self.cell_of(place_m)]))[0]))

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

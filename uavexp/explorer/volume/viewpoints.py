"""The clusters of a frontier and the places that show them, kept while neither has changed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uavexp.arrays import Bool, Float, Int, Int32
from uavexp.explorer.volume.cells import Cells
from uavexp.explorer.volume.clusters import clusters_of
from uavexp.explorer.volume.views import Places, Sight, is_place, look_from, offsets_around, seen_from
from uavexp.field import TILE

_SAMPLE = 16  # cells of a cluster that stand for it when places are sought
_KEPT = 12  # places of a cluster, of those that show the most
_NEAR_BEST = 0.7  # share of the most cells shown that is enough
_OFFSETS = offsets_around()


@dataclass(frozen=True, slots=True)
class Cluster:
    """Frontier cells and where they may be seen from."""

    cells: Int  # (C,)
    middle: int  # the cell nearest to the middle of all
    eyes_m: Float  # (E, 3) places that show about the most of them
    yaws_rad: Float  # (E,) with which they do
    eyes: Int  # (E,) cells of the places
    stamp: int  # how often the map around had changed when they were sought


class Viewpoints:
    """Clusters and places on one map.

    Args:
        cells: of the map.
        sight: the sensor.
        places: what a place has to be.
        least: fewer joined frontier cells are no cluster.
        most: cells along the edge of a cluster.
    """

    def __init__(self, cells: Cells, sight: Sight, places: Places, least: int, most: int) -> None:
        self._cells, self._sight, self._places = cells, sight, places
        self._least, self._most = least, most
        self._number: Int32 = np.zeros(cells.kind.size, np.int32)
        self._known: dict[bytes, Cluster] = {}

    def clusters(self, looks: int, here_m: Float) -> list[Cluster]:
        """All clusters of the frontier now; those that no place shows have no eyes.

        Args:
            looks: cells looked at so often in vain are no frontier.
            here_m: (3,) the vehicle, a place like others.
        """
        cells = self._cells
        frontier = cells.frontier(looks)
        index = cells.index(frontier)
        known = {}
        for members in clusters_of(frontier, index, cells.steps, self._number, self._least, self._most):
            key = members.tobytes()
            cluster = self._known.get(key)
            if cluster is None or self._is_stale(cluster):
                cluster = self._sought(members, here_m)
            known[key] = cluster
        self._known = known
        return list(known.values())

    def is_place(self, point_m: Float) -> bool:
        """Whether the body may wait at a point (3,)."""
        return bool(is_place(self._places, *point_m))

    def shown(self, eye_m: Float, yaw_rad: float, cells: Int) -> Int:
        """Which of cells (C,) the sensor sees from a place with a yaw."""
        seen: Bool = seen_from(self._places, self._sight, eye_m, yaw_rad, self._cells.centre_m(cells))
        return cells[seen]

    def _is_stale(self, cluster: Cluster) -> bool:
        """Whether its places have to be sought anew: the first is none any more, or there may be some now."""
        if len(cluster.eyes):
            return not self.is_place(cluster.eyes_m[0])
        return cluster.stamp != self._changes_around(self._cells.centre_m(cluster.cells[:1])[0])

    def _changes_around(self, point_m: Float) -> int:
        """How often the map has changed within sight of a point."""
        field = self._cells.field
        tile = np.floor((point_m[:2] - field.origin_m[:2]) / field.voxel_size_m / TILE)
        reach = self._sight.range_m / field.voxel_size_m / TILE
        low, high = np.maximum(tile - reach, 0).astype(int), (tile + reach + 1).astype(int)
        return int(field.changed[low[0] : high[0], low[1] : high[1]].sum())

    def _sought(self, members: Int, here_m: Float) -> Cluster:
        """A cluster of these cells (C,) with its places."""
        cells = self._cells
        centre_m = cells.centre_m(members)
        mean_m = centre_m.mean(axis=0)
        middle = int(np.argmin(((centre_m - mean_m) ** 2).sum(axis=1)))
        sample = centre_m[np.linspace(0, len(members) - 1, min(len(members), _SAMPLE)).astype(int)]
        eyes_m = np.concatenate([mean_m + _OFFSETS, here_m[None]])
        count, yaws = look_from(self._places, self._sight, eyes_m, sample, _NEAR_BEST)
        good = np.flatnonzero(count)
        good = good[np.argsort(-count[good], kind="stable")][:_KEPT]
        return Cluster(
            cells=members,
            middle=int(members[middle]),
            eyes_m=eyes_m[good],
            yaws_rad=yaws[good],
            eyes=cells.of(eyes_m[good]),
            stamp=self._changes_around(centre_m[0]),
        )

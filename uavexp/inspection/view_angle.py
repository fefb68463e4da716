"""View-angle planner of paper 3 (algorithm 2): the yaw that sees the most of what matters.

Whether a cell is in sight does not depend on the yaw, so one round of rays serves all
candidates; a candidate then adds up the weights of the cells inside its image.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numba as nb
import numpy as np

from uavexp.arrays import Bool, Float, Int
from uavexp.errors import require, require_non_negative
from uavexp.field import DistanceField
from uavexp.inspection.reference_surface import Surface
from uavexp.inspection.viewpoints import Viewpoints
from uavexp.inspection.visibility import Camera, Grid, Optics, Views, framed_turns, half_turn, sighted_cells


@dataclass(frozen=True, slots=True, kw_only=True)
class Weights:
    """What a cell is worth; the paper gives the order only.

    Attributes:
        occluded: of a cell that a blocked viewpoint would have seen, and none has yet.
        plain: of any other.
        scanned: of a cell that has been seen.
    """

    occluded: float = 5.0
    plain: float = 1.0
    scanned: float = 0.02

    def __post_init__(self) -> None:
        require_non_negative(scanned=self.scanned)
        require(
            self.scanned < self.plain < self.occluded,
            f"weights must rise from scanned to plain to occluded, got {self.scanned}, {self.plain}, "
            f"{self.occluded}",
        )


class ViewAngle(NamedTuple):
    """The best yaw and its score, and every candidate's."""

    yaw_rad: float
    score: float
    scores: Float  # (Y,)


def blocked_viewpoints(field: DistanceField, viewpoints: Viewpoints, clearance_m: float) -> Bool:
    """Whether the live map leaves the vehicle no room at each viewpoint (V,)."""
    return np.asarray(field.distance_m(viewpoints.position_m) < clearance_m)


def cell_weights(surface: Surface, views: Views, blocked: Bool, scanned: Bool, weights: Weights) -> Float:
    """Weight of each cell (N,), m²: its area times what it is worth.

    Args:
        surface: target cells (N,).
        views: cells that each viewpoint sees in M_R.
        blocked: viewpoints (V,) that the live map has turned out to block.
        scanned: cells (N,) already seen.
        weights: of the three kinds.
    """
    worth = np.full(len(surface), weights.plain)
    for view in np.flatnonzero(blocked):
        worth[views.of(int(view))] = weights.occluded
    worth[scanned] = weights.scanned
    return np.asarray(worth * surface.area_m2)


def choose_yaw(
    grid: Grid,
    camera: Camera,
    surface: Surface,
    weight: Float,
    position_m: Float,
    nominal_yaw_rad: float,
    candidates: int = 72,
) -> ViewAngle:
    """The yaw with the highest weighted sum of cells seen; the nearest to the nominal one of equals.

    Args:
        grid: the live map; only occupied voxels block sight.
        camera: that looks.
        surface: target cells (N,).
        weight: of each cell (N,).
        position_m: (3,) of the camera.
        nominal_yaw_rad: the plan's.
        candidates: yaws over 360°, evenly spaced, the nominal one among them.
    """
    require(candidates >= 1, f"candidates must be >= 1, got {candidates}")
    position, point_m = np.ascontiguousarray(position_m, dtype=np.float64), surface.point_m
    seen = sighted_cells(grid, camera.optics, position, point_m, surface.normal, weight > 0.0)
    turn = 2.0 * math.pi / candidates * _nearest_first(candidates)
    yaws = nominal_yaw_rad + turn
    scores = _scores(camera.optics, position, yaws, point_m[seen], weight[seen])
    best = int(np.argmax(scores > scores.max() - 1e-9))
    yaw = math.remainder(nominal_yaw_rad + float(turn[best]), 2.0 * math.pi)
    return ViewAngle(yaw, float(scores[best]), scores)


def _nearest_first(candidates: int) -> Int:
    """Multiples of the spacing, 0, 1, -1, 2, -2, ..., so many."""
    index = np.arange(candidates)
    return np.asarray((index + 1) // 2 * np.where(index % 2 == 1, 1, -1))


@nb.njit(cache=True)
def _scores(optics: Optics, eye: Float, yaws: Float, point: Float, weight: Float) -> Float:
    """Sum of the weights of the cells (N,) in the image with each yaw (Y,)."""
    scores = np.zeros(yaws.shape[0])
    for n in range(point.shape[0]):
        azimuth_rad, half_rad = framed_turns(optics, eye, point[n])
        for y in range(yaws.shape[0]):
            if abs(half_turn(azimuth_rad - yaws[y])) <= half_rad:
                scores[y] += weight[n]
    return scores

"""The parts of a building's free space in which a body with its clearance is joined."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from uavexp.arrays import Bool, Float, Int, Int32, UInt8
from uavexp.scene import Scene
from uavexp.space import FREE, SOLID, UNMEASURED, Space
from uavexp.world.shortest import make_nodes, passable_nodes, proof_radius_m
from uavexp.world.task import CELL_M

_TOLD_M2 = 0.5  # parts of less floor are not told of
_TOLD = 3  # parts at most that are told one by one
_ABOUT = 0.9  # share of the most
_COLUMNS = 2000  # at most, in which the floor is looked for


@dataclass(frozen=True, slots=True, kw_only=True)
class FreeParts:
    """Nodes of a lattice that keep a clearance, by the part in which they are joined."""

    low_m: Float  # (3,) centre of node (0, 0, 0)
    number: Int32  # (X, Y, Z) part of each node from 1; 0: none
    inside: Bool  # (X, Y, Z) whether it lies in free space inside the building
    enclosed: bool  # whether any does; else all nodes count as inside
    largest: int  # number of the part with most nodes inside; 0: there is none

    def places_m(self, index: Int) -> Float:
        """Places (N, 3) of nodes with these indices (N, 3)."""
        return np.asarray(self.low_m + index * CELL_M)

    def fullest_height_m(self) -> float:
        """Height in the middle of the layers in which the largest part has about most nodes, m."""
        layers = np.count_nonzero(self.inside & (self.number == self.largest), axis=(0, 1))
        full = np.flatnonzero(layers >= _ABOUT * layers.max())
        return float(self.low_m[2] + full[len(full) // 2] * CELL_M)

    def number_at(self, points_m: Float) -> Int32:
        """Part (N,) of the node nearest to each point (N, 3); 0: none, or not inside."""
        index = np.rint((points_m - self.low_m) / CELL_M).astype(np.int64)
        index = np.clip(index, 0, np.array(self.number.shape) - 1)
        at = tuple(index.T)
        return np.asarray(np.where(self.inside[at], self.number[at], 0))

    def nearest_m(self, point_m: Float) -> Float | None:
        """The node inside that is nearest to a point (3,); None when there is none."""
        if not self.inside.any():
            return None
        axes = [
            (self.low_m[a] + CELL_M * np.arange(n) - point_m[a]) ** 2 for a, n in enumerate(self.inside.shape)
        ]
        squared = axes[0][:, None, None] + axes[1][:, None] + axes[2]
        squared[~self.inside] = np.inf
        nearest = np.array([np.unravel_index(squared.argmin(), squared.shape)])
        return np.asarray(self.places_m(nearest)[0])


@dataclass(frozen=True, slots=True, kw_only=True)
class Part:
    """A part as people are told of it."""

    floor_m2: float
    middle_m: Float  # (3,) one of its places, near to its middle


def free_parts(scene: Scene, flight_bounds_m: Float, clearance_m: float, space: Space) -> FreeParts:
    """Cut the free space within the flight bounds into parts; 26-connected, each edge with its clearance.

    Places that were never measured join parts where they can be flown through; none lies inside.
    """
    nodes = make_nodes(
        scene.grid, flight_bounds_m, CELL_M, proof_radius_m(clearance_m, math.sqrt(3.0) * CELL_M)
    )
    low_m = flight_bounds_m[0] + 0.5 * CELL_M
    state = _states(space, low_m, (int(nodes.shape[0]), int(nodes.shape[1]), int(nodes.shape[2])))
    passable = passable_nodes(nodes).reshape(state.shape) > 0
    passable &= state != SOLID
    if space.unmeasured_is_solid:
        passable &= state != UNMEASURED
    number = np.asarray(ndimage.label(passable, structure=np.ones((3, 3, 3)))[0], dtype=np.int32)
    inside = passable & (state == FREE)
    enclosed = bool(inside.any())
    if not enclosed:
        inside = passable & (state != UNMEASURED)
    sizes = np.bincount(number[inside], minlength=2)
    return FreeParts(
        low_m=low_m,
        number=number,
        inside=inside,
        enclosed=enclosed,
        largest=int(sizes.argmax()) if sizes.any() else 0,
    )


def _states(space: Space, low_m: Float, shape: tuple[int, int, int]) -> UInt8:
    """State of space (X, Y, Z) at the nodes, slice by slice."""
    state = np.empty(shape, dtype=np.uint8)
    j, k = np.meshgrid(np.arange(shape[1]), np.arange(shape[2]), indexing="ij")
    level = np.asarray(low_m + np.column_stack([np.zeros(j.size), j.ravel(), k.ravel()]) * CELL_M, float)
    for i in range(shape[0]):
        level[:, 0] = low_m[0] + i * CELL_M
        state[i] = space.state_at(level).reshape(shape[1:])
    return state


def floor_m(scene: Scene, parts: FreeParts) -> float:
    """Height of the floor under the largest part: the median of what lies below its columns; NaN: nothing."""
    own = parts.inside & (parts.number == parts.largest)
    columns = np.argwhere(own.any(axis=2))
    columns = columns[:: max(1, len(columns) // _COLUMNS)]
    lowest = own[tuple(columns.T)].argmax(axis=1)
    places = parts.places_m(np.column_stack([columns, lowest]))
    down = np.hstack([places, np.broadcast_to([0.0, 0.0, -1.0], places.shape)]).astype(np.float32)
    fall_m = scene.fixed_cast(down)[0].astype(np.float64)
    met = np.isfinite(fall_m)
    return float(np.median(places[met, 2] - fall_m[met])) if met.any() else math.nan


def notes_of(parts: FreeParts) -> list[str]:
    """What is to be told of the parts: that nothing is enclosed, or that rooms or floors are not joined."""
    notes = []
    if not parts.enclosed:
        notes.append("no walls enclose a part of it: start and target are drawn from all its free space")
    told_of = parts_told(parts)
    if len(told_of) > 1:
        largest, *others = told_of
        told = [f"{part.floor_m2:.1f} m² at {text(part.middle_m)}" for part in others[:_TOLD]]
        verb, noun = ("is", "part") if len(others) == 1 else ("are", "parts")
        notes.append(
            f"{len(others)} other free {noun} {verb} not joined with the largest of "
            f"{largest.floor_m2:.1f} m²: {', '.join(told)}{', ...' if len(others) > _TOLD else ''}"
        )
    return notes


def parts_told(parts: FreeParts) -> list[Part]:
    """The parts that are worth telling of: the one with most nodes, then the others, most floor first."""
    columns = np.argwhere((parts.inside & (parts.number > 0)).any(axis=2))
    area_m2 = np.zeros(parts.number.max() + 1)
    for column in columns:
        stack = parts.number[tuple(column)][parts.inside[tuple(column)]]
        area_m2[np.unique(stack)] += CELL_M**2
    told = np.flatnonzero(area_m2 >= _TOLD_M2)
    told = told[np.argsort(-area_m2[told], kind="stable")]
    told = told[np.argsort(told != parts.largest, kind="stable")]
    return [Part(floor_m2=float(area_m2[n]), middle_m=_middle_m(parts, int(n))) for n in told]


def _middle_m(parts: FreeParts, number: int) -> Float:
    """A node of a part near to its middle (3,)."""
    places = parts.places_m(np.argwhere(parts.inside & (parts.number == number)))
    return np.asarray(places[np.linalg.norm(places - places.mean(axis=0), axis=1).argmin()])


def text(values: Float) -> str:
    """A point as it is typed."""
    return "[" + ",".join(f"{value:.12g}" for value in np.round(values, 2)) + "]"

"""Which space of a building is solid, free, outside or never measured: from a mesh, or from cells.

Meshes are not closed, their sides not oriented, and buildings have doors, windows and no roof; so
no single sign is relied on:

1. Cells that a triangle enters are surface, the others air. Holes narrower than a cell are shut.
2. Air is cut into the parts in which a body fits (`BODY_M` from every surface). One that reaches the
   border of the geometry's box is the surroundings; the main part is the one with most enclosed cells
   (`enclosure.enclosed`: votes of rays, Nooruddin and Turk 2003).
3. Another part is solid (a column, a machine, a thick wall) where its generalised winding number
   (Jacobson et al. 2013) differs by a whole turn from that of the main part next to it, at each of five
   places: so outward shells (room 1, box in it 2), inward ones (-1 and 0) and walls with an inside (room
   0, wall 1) are all told right, with holes, too. Where the orientation says nothing, or not the same
   everywhere, the part is a room that is not joined.
4. Air that is closed off and in which a body has no room (`ROOM_M`) is solid.
5. Air joined with the surroundings is outside where it is not enclosed; all other air is free.

Measured cells are what was measured; of the free ones those that reach the border of the map and are
not enclosed are outside. Cells that hold points, with nothing known of the others, are read like a mesh
without orientation.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from scipy import ndimage
from scipy.spatial import cKDTree

from uavexp.arrays import Bool, Float, Float32, Int, Int32, UInt8
from uavexp.space import FREE, OUTSIDE, SOLID, SURFACE, UNMEASURED, Space
from uavexp.world.enclosure import enclosed
from uavexp.world.raster import rasterise
from uavexp.world.voxel_model import squared_distance
from uavexp.world.winding import winding_numbers

CELL_M = 0.1
MAX_CELLS = 60_000_000  # a larger building gets larger cells
BEYOND_M = 3.0  # around the part of a larger building that is asked for
BODY_M = 0.2  # where the body's centre fits is this far from any surface
ROOM_M = 0.35  # where a body has room its centre is this far from any surface
_PLACES = 5  # of a part at which winding numbers are asked
_TURN_OFF = 0.25  # by which a difference of winding numbers may miss a whole one
_CUT_OUT = 0.05  # share of a rock that the rooms in it take at least
_REACH = 3  # cells that belong to the part around which they lie
_NEIGHBOURS = 2000  # places of the main part among which the nearest one is looked for


def space_of_mesh(
    vertices_m: Float32, triangles: Int32, bounds_m: Float | None = None, inside_m: Float | None = None
) -> Space:
    """Space of a mesh.

    Args:
        vertices_m: (V, 3).
        triangles: (F, 3), at least one.
        bounds_m: box (2, 3) of a part of a building that is too large; None: all of it.
        inside_m: a place (3,) in the main part; None: it is told by its size.
    """
    corners = vertices_m[triangles].reshape(-1, 3)
    box = np.stack([corners.min(axis=0), corners.max(axis=0)]).astype(np.float64)
    if bounds_m is not None and np.prod((box[1] - box[0]) / CELL_M) > MAX_CELLS:
        box = np.clip(box, bounds_m[0] - BEYOND_M, bounds_m[1] + BEYOND_M)
    cell_m = max(CELL_M, float(np.prod(box[1] - box[0]) / MAX_CELLS) ** (1.0 / 3.0))
    margin = _margin(cell_m)
    low = box[0] - margin * cell_m
    shape = np.ceil((box[1] - low) / cell_m - 1e-6).astype(np.int64) + margin
    surface = rasterise(vertices_m, triangles, low, cell_m, shape)

    def winding(places: Int) -> Float:
        return np.asarray(winding_numbers(vertices_m, triangles, low + (places + 0.5) * cell_m))

    known = None if inside_m is None else np.clip(((inside_m - low) / cell_m).astype(np.int64), 0, shape - 1)
    state = np.where(surface, np.uint8(SURFACE), _air(surface, cell_m, winding, known))
    return Space(state=state, low_m=low, cell_m=np.full(3, cell_m))


def space_after(before: Space, vertices_m: Float32, triangles: Int32, inside_m: Float) -> Space:
    """Space of a building whose surfaces have changed; what was never measured before stays so.

    Args:
        before: its space until then.
        vertices_m: (V, 3).
        triangles: (F, 3).
        inside_m: a place (3,) in the main part.
    """
    after = space_of_mesh(vertices_m, triangles, inside_m=inside_m)
    if (before.state == UNMEASURED).any():
        j, k = (item.ravel() for item in np.indices(after.state.shape[1:]))
        for i, layer in enumerate(after.state):
            centres = after.low_m + (np.column_stack([np.full(j.size, i), j, k]) + 0.5) * after.cell_m
            layer[before.state_at(centres).reshape(layer.shape) == UNMEASURED] = UNMEASURED
    return replace(after, unmeasured_is_solid=before.unmeasured_is_solid)


def space_of_points(occupied: Bool, low_m: Float, cell_m: float) -> Space:
    """Space of cells (X, Y, Z) that hold points, with nothing known of the others."""
    margin = _margin(cell_m)
    blocked = np.pad(occupied, margin)
    state = np.where(blocked, np.uint8(SOLID), _air(blocked, cell_m, None))
    return Space(state=state, low_m=low_m - margin * cell_m, cell_m=np.full(3, cell_m))


def space_of_cells(
    state: UInt8, low_m: Float, cell_m: Float, yaw_rad: float = 0.0, *, is_plan: bool = False
) -> Space:
    """Space of measured cells.

    Args:
        state: (X, Y, Z), `UNMEASURED`, `FREE` or `SOLID`.
        low_m: lower corner of cell (0, 0, 0) (3,).
        cell_m: size along each axis (3,).
        yaw_rad: of the cells about the vertical through `low_m`.
        is_plan: whether the one layer lies between a floor and a ceiling.
    """
    edges = ((1, 1), (1, 1), (0, 0) if is_plan else (1, 1))
    label, _ = ndimage.label(np.pad(state == FREE, edges, constant_values=True))
    joined = (label == label[0, 0, 0])[1:-1, 1:-1, slice(None) if is_plan else slice(1, -1)]
    outside = joined & (state == FREE) & ~enclosed(state != FREE)
    padded = np.pad(np.where(outside, np.uint8(OUTSIDE), state), 1, constant_values=UNMEASURED)
    if is_plan:
        padded[..., [0, -1]] = SOLID
    c, s = np.cos(yaw_rad), np.sin(yaw_rad)
    corner = np.array([cell_m[0] * c - cell_m[1] * s, cell_m[0] * s + cell_m[1] * c, cell_m[2]])
    return Space(state=padded, low_m=low_m - corner, cell_m=np.asarray(cell_m, float), yaw_rad=yaw_rad)


def _margin(cell_m: float) -> int:
    """Cells of air around the geometry, so that a body fits around it."""
    return int(np.ceil(BODY_M / cell_m)) + 1


def _air(
    blocked: Bool, cell_m: float, winding: Callable[[Int], Float] | None, known: Int | None = None
) -> UInt8:
    """State (X, Y, Z) of the cells of air, whatever the others get.

    Args:
        blocked: cells (X, Y, Z) that are not air.
        cell_m: size of a cell.
        winding: gives winding numbers at cells (N, 3); None: nothing is oriented.
        known: a cell (3,) of the main part.
    """
    inside = enclosed(blocked)
    air, _ = ndimage.label(~blocked)
    state = np.where((air == air[0, 0, 0]) & ~inside, np.uint8(OUTSIDE), np.uint8(FREE))
    squared = np.ascontiguousarray(squared_distance(blocked, ROOM_M / cell_m))
    fits, room = squared >= (BODY_M / cell_m) ** 2, squared >= (ROOM_M / cell_m) ** 2
    part, count = ndimage.label(fits)
    main = int(np.bincount(part[inside & fits], minlength=count + 2)[1:].argmax()) + 1
    if known is not None and part[tuple(known)]:
        main = int(part[tuple(known)])
    told = np.zeros(count + 1, dtype=np.bool_)
    if winding is not None:
        told = _other_side(part, room, main, winding, may_be_solid=known is None)
    open_ = np.zeros(air.max() + 1, dtype=np.bool_)  # parts of air in which a body has room
    open_[air[room & ~told[part]]] = True
    open_[[air[0, 0, 0], *air[part == main][:1]]] = True
    _close(state, air, part, told & _holds(part, open_[air], count))
    state[~open_[air]] = SOLID
    return state


def _holds(part: Int32, where: Bool, count: int) -> Bool:
    """Which parts (count + 1,) have a cell there."""
    held = np.zeros(count + 1, dtype=np.bool_)
    held[part[where]] = True
    return held


def _other_side(
    part: Int32, room: Bool, main: int, winding: Callable[[Int], Float], *, may_be_solid: bool
) -> Bool:
    """Which parts (count + 1,) lie on the other side of oriented surfaces than the main one.

    Never the surroundings, which hold cell (0, 0, 0). Solids have the higher winding number: where much
    room has a lower one than the main part, that is the rock into which this room is cut.

    Args:
        part: number (X, Y, Z) of each cell's part, 0 of none.
        room: cells with room around them, at which winding numbers are asked.
        main: number of the main part.
        winding: of cells (N, 3).
        may_be_solid: whether the main part may be such a rock.
    """
    told = np.zeros(part.max() + 1, dtype=np.bool_)
    near = np.flatnonzero(room & (part == main))
    of_main = np.column_stack(np.unravel_index(near[:: max(1, len(near) // _NEIGHBOURS)], part.shape))
    places = np.argwhere(room & (part != main) & (part != part[0, 0, 0]))
    if len(of_main) == 0 or len(places) == 0:
        return told
    number = part[tuple(places.T)]
    order = np.argsort(number, kind="stable")
    names, first, counts = np.unique(number[order], return_index=True, return_counts=True)
    share = (np.arange(_PLACES) + 0.5) / _PLACES
    there = places[order[(first[:, None] + share * counts[:, None]).astype(np.int64)]]
    here = of_main[cKDTree(of_main).query(there)[1]]
    asked = winding(np.concatenate([there, here]).reshape(-1, 3)).reshape(2, -1, _PLACES)
    turns = asked[0] - asked[1]
    whole = np.rint(turns)
    told[names] = ((whole != 0.0) & (np.abs(turns - whole) <= _TURN_OFF)).all(axis=1)
    lower = told[names] & (whole < 0.0).all(axis=1)
    if may_be_solid and counts[lower].sum() > _CUT_OUT * len(near):
        main = int(names[lower][counts[lower].argmax()])
        return _other_side(part, room, main, winding, may_be_solid=False)
    return told


def _close(state: UInt8, air: Int32, part: Int32, told: Bool) -> None:
    """Make parts of the air solid, with the air around them that is nearer to them than to other parts."""
    if told[1:].any():
        inner = told[part]
        near = ndimage.binary_dilation(inner, iterations=_REACH) & (air > 0)
        state[inner | (near & ~ndimage.binary_dilation((part > 0) & ~inner, iterations=_REACH))] = SOLID

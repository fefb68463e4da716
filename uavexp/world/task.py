"""The task in a world: whether start and target are joined, how far apart, how hard.

Everything is measured on the true triangles. "Joined with a clearance" is proved, not
sampled (`shortest`): a found path keeps the clearance all along, ends included.
"""

from __future__ import annotations

import hashlib
import math
from itertools import pairwise

import numpy as np
from scipy import ndimage

from uavexp.arrays import Float, Float32, Int32
from uavexp.geometry import polyline_length_m
from uavexp.scene import Scene
from uavexp.space import Space
from uavexp.types import Difficulty, World
from uavexp.world.line_of_sight import skip_ahead, tighten
from uavexp.world.shortest import (
    empty_columns,
    make_nodes,
    passable_layer,
    proof_radius_m,
    shortest_lattice_path,
)
from uavexp.world.solidity import space_of_mesh

CELL_M = 0.1  # spacing of the lattice on which the shortest path is exact
FINE_CELL_M = 0.05  # tried where that one is too coarse for a building's passages
LAYER_CELL_M = 0.2  # spacing of the layer from which start and target are drawn
MAX_KNOTS = 120  # points of a path that is being tightened
MIN_KNOT_STEP_M = 0.2
TIGHTEN_ROUNDS = 3
BAND_M = 0.6  # height of the band in which clutter is measured, around the start's height
GAP_STEP_M = 0.05  # between the points where the width of the passage is measured
GAP_CHORDS = 7  # directions tried at each


def shortest_path(
    scene: Scene,
    flight_bounds_m: Float,
    start_m: Float,
    target_m: Float,
    clearance_m: float,
    cell_m: float = CELL_M,
) -> Float:
    """Shortest known path (P, 3) that keeps `clearance_m` from every surface.

    The exact shortest 26-connected path on a lattice, pulled tight by lines of sight: an
    upper bound of the true shortest length, in practice within about 1 % of it. A lattice
    misses passages that are wider than twice the clearance by less than about its spacing.

    Returns:
        The path, ends included; (0, 3) when the two are not joined.
    """
    path = lattice_path(scene, flight_bounds_m, start_m, target_m, clearance_m, cell_m)
    return tightened(scene, path, clearance_m) if path.shape[0] else path


def lattice_path(
    scene: Scene,
    flight_bounds_m: Float,
    start_m: Float,
    target_m: Float,
    clearance_m: float,
    cell_m: float = CELL_M,
) -> Float:
    """The exact shortest path (P, 3) on the lattice; arguments and return as `shortest_path`."""
    radius_m = proof_radius_m(clearance_m, math.sqrt(3.0) * cell_m)
    nodes = make_nodes(scene.grid, flight_bounds_m, cell_m, radius_m)
    path: Float = shortest_lattice_path(nodes, clearance_m, start_m, target_m)
    return path


def tightened(scene: Scene, path_m: Float, clearance_m: float) -> Float:
    """A path (P, 3) that keeps a clearance, pulled tight by lines of sight that keep it."""
    path_m = skip_ahead(scene.grid, path_m, clearance_m)
    for _ in range(TIGHTEN_ROUNDS):
        path_m = tighten(scene.grid, _knots(path_m), clearance_m)
    return path_m


def _knots(path_m: Float) -> Float:
    """The path's own points and more between them, so that tightening can move its corners."""
    step = max(MIN_KNOT_STEP_M, polyline_length_m(path_m) / MAX_KNOTS)
    pieces = [path_m[:1]]
    for a, b in pairwise(path_m):
        count = max(1, math.ceil(float(np.linalg.norm(b - a)) / step))
        pieces.append(a + (b - a) * (np.arange(1, count + 1) / count)[:, None])
    return np.concatenate(pieces)


def free_layer(
    scene: Scene, flight_bounds_m: Float, height_m: float, clearance_m: float
) -> tuple[Float, Int32, Int32]:
    """Points at one height that keep `clearance_m`, and which of them are joined in that plane.

    Returns:
        Points (N, 3), the number (N,) of each one's connected part from 0, and the parts'
        sizes in points.
    """
    radius_m = proof_radius_m(clearance_m, math.sqrt(2.0) * LAYER_CELL_M)
    free = passable_layer(make_nodes(scene.grid, flight_bounds_m, LAYER_CELL_M, radius_m), height_m)
    labels = np.asarray(ndimage.label(free, structure=np.ones((3, 3)))[0], dtype=np.int32)
    index = np.argwhere(free)
    points = np.column_stack(
        [flight_bounds_m[0, :2] + (index + 0.5) * LAYER_CELL_M, np.full(index.shape[0], height_m)]
    )
    part = labels[free] - 1
    return points, part, np.bincount(part).astype(np.int32)


def clutter_density(scene: Scene, flight_bounds_m: Float, start_m: Float) -> float:
    """Share of the band around the start's height that air around the start does not fill.

    A column of 0.1 m by 0.1 m, `BAND_M` high, is air when no surface enters it and when such
    columns join it with the start; so the inside of a closed solid counts as occupied,
    whether the mesh has an inside or not, and so does what lies behind a closed wall.
    """
    nodes = make_nodes(scene.grid, flight_bounds_m, CELL_M)
    half = np.array([0.5 * CELL_M, 0.5 * CELL_M, 0.5 * BAND_M])
    air = empty_columns(nodes, float(start_m[2]), half)
    labels = ndimage.label(air)[0]
    i, j = np.minimum(((start_m[:2] - flight_bounds_m[0, :2]) / CELL_M).astype(int), nodes.shape[:2] - 1)
    return 1.0 - float(np.count_nonzero(labels == labels[i, j])) / air.size if air[i, j] else 1.0


def narrowest_gap_m(scene: Scene, path_m: Float) -> float:
    """Width of the narrowest passage along the path (P, 3), m: a doorway's free width.

    The least horizontal chord of free space through a point of the path, over the chords
    within 45° of the perpendicular to it. (Twice the clearance along the path would say
    nothing: a shortest path always rounds corners at exactly the required clearance.)
    """
    steps = np.diff(path_m, axis=0)
    counts = np.maximum(1, np.ceil(np.linalg.norm(steps, axis=1) / GAP_STEP_M)).astype(np.int64)
    segment = np.repeat(np.arange(steps.shape[0]), counts)
    share = np.concatenate([(np.arange(count) + 0.5) / count for count in counts])
    points = path_m[segment] + share[:, None] * steps[segment]
    across = np.arctan2(steps[segment, 1], steps[segment, 0]) + 0.5 * math.pi
    chord = np.full(points.shape[0], np.inf)
    for turn in np.linspace(-0.25 * math.pi, 0.25 * math.pi, GAP_CHORDS):
        along = np.column_stack([np.cos(across + turn), np.sin(across + turn), np.zeros_like(across)])
        left = scene.cast(np.hstack([points, along]).astype(np.float32))[0]
        right = scene.cast(np.hstack([points, -along]).astype(np.float32))[0]
        chord = np.minimum(chord, left.astype(np.float64) + right)
    return float(chord.min())


def assemble(
    *,
    name: str,
    scene: Scene,
    vertices_m: Float32,
    triangles: Int32,
    bounds_m: Float,
    flight_bounds_m: Float,
    path_m: Float,
    space: Space | None = None,
    notes: tuple[str, ...] = (),
) -> World:
    """Return the world of a geometry and the shortest path in it (from which start and target come).

    The start yaw is the bearing of the target, not the direction of the path, which the
    vehicle cannot know. Without a `space` it is that of the mesh.
    """
    start, target = path_m[0], path_m[-1]
    yaw = math.atan2(target[1] - start[1], target[0] - start[0])
    difficulty = Difficulty(
        clutter_density=clutter_density(scene, flight_bounds_m, start),
        narrowest_gap_m=narrowest_gap_m(scene, path_m),
        straight_line_m=float(np.linalg.norm(target - start)),
        shortest_path_m=polyline_length_m(path_m),
    )
    digest = hashlib.sha256()
    for array in (vertices_m, triangles, bounds_m, flight_bounds_m, start, target):
        digest.update(str(array.shape).encode())
        digest.update(np.ascontiguousarray(array).tobytes())
    return World(
        name=name,
        vertices_m=vertices_m,
        triangles=triangles,
        bounds_m=bounds_m,
        flight_bounds_m=flight_bounds_m,
        start_m=start.copy(),
        start_yaw_rad=yaw,
        target_m=target.copy(),
        shortest_path=path_m,
        difficulty=difficulty,
        digest=digest.hexdigest(),
        space=space_of_mesh(vertices_m, triangles) if space is None else space,
        notes=notes,
    )

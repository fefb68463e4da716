"""Travel lengths that respect walls: shortest paths over the lattice.

Between two points the length is that of the straight line where the vehicle fits along it,
else that of the shortest path over the lattice, an upper bound of the true one.
"""

from __future__ import annotations

import numba as nb
import numpy as np

from uavexp.arrays import Bool, Float, Float32, Int, Int32
from uavexp.inspection.travel_lattice import EDGE_UNITS, Lattice

_FINE_UNITS = 8000  # the same between points, where edges are long
_NEAREST = 100  # points that the wave from a point must reach; those beyond go through them


def gates(lattice: Lattice, points_m: Float) -> tuple[Int, Float]:
    """Nodes through which points (N, 3) enter the lattice: numbers (N, 8), -1 for none, and legs m.

    A point among no free nodes, as the start may be, enters through the nearest one within
    the three cells in which `lattice_of` looks for it.
    """
    number, leg = _corner_gates(lattice, points_m)
    if lattice.position_m.shape[0] > 0:
        for point in np.flatnonzero((number < 0).all(axis=1)):
            apart = np.linalg.norm(lattice.position_m - points_m[point], axis=1)
            if apart.min() <= 3.0 * lattice.step_m.max():
                number[point, 0], leg[point, 0] = apart.argmin(), apart.min()
    return number, leg


def _corner_gates(lattice: Lattice, points_m: Float) -> tuple[Int, Float]:
    """The corners of the lattice's cell around each point to which the vehicle fits halfway."""
    low = np.floor((points_m - lattice.origin_m) / lattice.step_m).astype(np.int64)
    shape = np.array(lattice.node.shape)
    corner = np.array([(i, j, k) for i in (0, 1) for j in (0, 1) for k in (0, 1)])
    index = np.clip(low[:, None] + corner, 0, shape - 1)
    number = lattice.node[index[..., 0], index[..., 1], index[..., 2]].astype(np.int64)
    if lattice.position_m.shape[0] == 0:
        return np.full(number.shape, -1), np.full(number.shape, np.inf)
    node_m = lattice.position_m[number]
    leg = np.linalg.norm(node_m - points_m[:, None], axis=2)
    halfway = 0.5 * (node_m + points_m[:, None])
    room = lattice.field.distance_m(halfway.reshape(-1, 3)).reshape(leg.shape)
    open_ = (
        (number >= 0) & (room >= 0.5 * lattice.clearance_m) & (leg <= 2.0 * np.linalg.norm(lattice.step_m))
    )
    return np.where(open_, number, -1), np.where(open_, leg, np.inf)


def is_reachable(lattice: Lattice, points_m: Float) -> Bool:
    """Whether the vehicle can come from the start to each point (N, 3) with its clearance (N,)."""
    number, _ = _corner_gates(lattice, points_m)
    reachable: Bool = (number >= 0).any(axis=1) & (lattice.field.distance_m(points_m) >= lattice.clearance_m)
    return reachable


def travel_lengths(lattice: Lattice, from_m: Float, to_m: Float) -> Float:
    """Lengths (F, T) from points (F, 3) to points (T, 3), m; inf where there is no way.

    Dijkstra (1959) with Dial's (1969) buckets, one run for each of the first points.
    """
    over = _waves(lattice, from_m, to_m, len(to_m) + 1)
    return np.asarray(np.minimum(over, _straight_in(lattice, from_m, to_m)))


def travel_matrix(lattice: Lattice, points_m: Float) -> Float:
    """Symmetric lengths (N, N) between points (N, 3), m, 0 on the diagonal.

    Waves over the lattice stop at the nearest hundred points; the way to farther ones leads
    through these, at most a few centimetres a leg longer by rounding. Where that does not
    join all, the waves run to the end.
    """
    near = _waves(lattice, points_m, points_m, _NEAREST)
    near = np.minimum(near, near.T)
    over = _through(near) if len(points_m) > _NEAREST else near
    if not np.isfinite(over).all():
        over = _waves(lattice, points_m, points_m, len(points_m) + 1)
    both = np.minimum(np.minimum(over, over.T), _straight_in(lattice, points_m, points_m))
    both = np.minimum(both, both.T)
    np.fill_diagonal(both, 0.0)
    return np.asarray(both)


def _waves(lattice: Lattice, from_m: Float, to_m: Float, enough: int) -> Float:
    number, leg = gates(lattice, from_m)
    other, other_leg = gates(lattice, to_m)
    edges = lattice.starts, lattice.ends, lattice.units, lattice.unit_m, EDGE_UNITS
    return np.asarray(_over_lattice(*edges, number, leg, other, other_leg, enough))


def _through(near: Float) -> Float:
    """Shortest ways (N, N) over the finite lengths between points (N, N)."""
    count = len(near)
    here, there = np.nonzero(np.isfinite(near) & ~np.eye(count, dtype=np.bool_))
    unit = max(float(near[here, there].max(initial=0.0)), 1e-3) / _FINE_UNITS
    starts = np.searchsorted(here, np.arange(count + 1)).astype(np.int32)
    units = np.ceil(near[here, there] / unit).astype(np.int32)
    own, nothing = np.arange(count)[:, None], np.zeros((count, 1))
    far = _over_lattice(
        starts, there.astype(np.int32), units, unit, _FINE_UNITS, own, nothing, own, nothing, count + 1
    )
    return np.asarray(np.minimum(near, far))


def _straight_in(lattice: Lattice, from_m: Float, to_m: Float) -> Float:
    field = lattice.field
    return np.asarray(
        _straight(field.distance, field.origin_m, field.voxel_size_m, lattice.clearance_m, from_m, to_m)
    )


@nb.njit(cache=True)
def _over_lattice(
    starts: Int32,
    ends: Int32,
    units: Int32,
    unit_m: float,
    longest: int,
    gate: Int,
    leg: Float,
    other: Int,
    other_leg: Float,
    enough: int,
) -> Float:
    """Least length (F, T) from any gate of one point to any gate of another, legs included.

    A wave ends when it has reached `enough` of the other points, never if there are fewer;
    lengths beyond are those of ways found so far, or inf. `longest` bounds the units of an edge.
    """
    buckets = longest + 2
    length = np.full((gate.shape[0], other.shape[0]), np.inf)
    nodes = starts.shape[0] - 1
    far = np.int32(2**31 - 1)
    reached = np.empty(nodes, dtype=np.int32)
    asked = np.zeros(nodes, dtype=np.int32)  # points whose nearest gate this is
    for target in range(other.shape[0]):
        best = np.argmin(other_leg[target])
        if other[target, best] >= 0:
            asked[other[target, best]] += 1
    node_of = np.empty(ends.shape[0] + gate.shape[1], dtype=np.int32)  # entries of the bucket lists
    following = np.empty_like(node_of)
    head = np.empty(buckets, dtype=np.int32)
    for source in range(gate.shape[0]):
        reached[:] = far
        head[:] = -1
        _spread(starts, ends, units, unit_m, gate[source], leg[source], asked, enough, reached, head,
                node_of, following)  # fmt: skip
        for target in range(other.shape[0]):
            for item in range(other.shape[1]):
                node = other[target, item]
                if node >= 0 and reached[node] < far:
                    way = reached[node] * unit_m + other_leg[target, item]
                    length[source, target] = min(length[source, target], way)
    return length


@nb.njit(cache=True)
def _spread(
    starts: Int32, ends: Int32, units: Int32, unit_m: float, gate: Int, leg: Float, asked: Int32,
    enough: int, reached: Int32, head: Int32, node_of: Int32, following: Int32,
) -> None:  # fmt: skip
    """Send one wave from the gates of a point; `head`, `node_of`, `following` are its buckets' lists."""
    buckets = head.shape[0]
    entries, waiting, now, found = 0, 0, 0, 0
    for item in range(gate.shape[0]):
        node = gate[item]
        if node >= 0:
            reached[node] = min(reached[node], np.int32(leg[item] / unit_m + 0.5))
    for item in range(gate.shape[0]):  # legs of any length: entered when their time comes
        node = gate[item]
        if node >= 0:
            node_of[entries], following[entries] = node, head[reached[node] % buckets]
            head[reached[node] % buckets] = entries
            entries, waiting = entries + 1, waiting + 1
    while waiting > 0 and found < enough:
        entry = head[now % buckets]
        if entry < 0:
            now += 1
            continue
        later = -1
        while entry >= 0:
            head[now % buckets] = following[entry]
            node = node_of[entry]
            if reached[node] > now:  # a long leg, of a later round
                following[entry], later = later, entry
            elif reached[node] == now:
                waiting -= 1
                found += asked[node]
                for edge in range(starts[node], starts[node + 1]):
                    near, there = ends[edge], now + units[edge]
                    if there < reached[near]:
                        reached[near] = there
                        node_of[entries], following[entries] = near, head[there % buckets]
                        head[there % buckets] = entries
                        entries, waiting = entries + 1, waiting + 1
            else:
                waiting -= 1  # outdated
            entry = head[now % buckets]
        head[now % buckets] = later
        now += 1


@nb.njit(cache=True)
def _straight(
    distance: Float32, origin: Float, voxel: float, clearance: float, from_m: Float, to_m: Float
) -> Float:
    """Length (F, T) of the straight line where its inside keeps the clearance, else inf.

    Marched in strides of the room there is (sphere tracing, Hart 1996), half a voxel at
    least. Read from the nearest voxel, which tells distances to half a voxel.
    """
    length = np.full((from_m.shape[0], to_m.shape[0]), np.inf)
    shape = distance.shape
    for a in range(from_m.shape[0]):
        for b in range(to_m.shape[0]):
            x, y, z = to_m[b, 0] - from_m[a, 0], to_m[b, 1] - from_m[a, 1], to_m[b, 2] - from_m[a, 2]
            total = np.sqrt(x * x + y * y + z * z)
            along, clear = 0.0, True
            while along < total:
                share = along / total
                i = int((from_m[a, 0] + x * share - origin[0]) / voxel)
                j = int((from_m[a, 1] + y * share - origin[1]) / voxel)
                k = int((from_m[a, 2] + z * share - origin[2]) / voxel)
                i, j, k = (
                    min(max(i, 0), shape[0] - 1),
                    min(max(j, 0), shape[1] - 1),
                    min(max(k, 0), shape[2] - 1),
                )
                room = distance[i, j, k] - clearance
                if room < -0.5 * voxel:
                    clear = False
                    break
                along += max(room, 0.5 * voxel)
            if clear:
                length[a, b] = total
    return length

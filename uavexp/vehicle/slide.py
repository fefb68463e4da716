"""Where a motion of the body box ends that would run into something: half-spaces and projections.

The body at the begin of the step is free, so at a place where box and scene are locally
nearest, found by projecting to and fro between the two, the plane through the scene's point
across the gap has the box on one side. The box at the end of the step must stay on that
side: half-spaces for the displacement (through the reach of the turned box, which pushes it
off when it turns against a wall) and for the velocity. Both are projected on them. An exact
test of the outcome decides; what still touches is cut short, down to the pose before at rest.

Movers are convex, so one plane separates each of them from the box (`bodies`). The plane
moves on with its mover, and the velocity is lost relative to it. Where a mover and a fixed
surface leave no room, the fixed surface holds.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import product
from typing import TYPE_CHECKING, NamedTuple

import numba as nb
import numpy as np

from uavexp.arrays import Float
from uavexp.bodies import separating_planes
from uavexp.geometry import rotation_from_quaternion
from uavexp.types import Bodies, State

if TYPE_CHECKING:
    from uavexp.scene import Scene

_SKIN_M = 1e-3  # gap left after a contact: points of the scene are float32
_LEAST_GAP_M = 5e-3  # below it, the direction across the gap is off by a thousandth or more
_CORE = 0.3  # depth of the inner box under the faces, as a share of the smallest half size
_ROUNDS = 6  # of projections between box and scene
_PUSH_OUT_M = 0.01  # a step, at most: 1 m/s out of a mover that the box is in, whatever put it there
# starting points of the search for near places, in half sizes: centre, faces, corners
_STARTS = np.array([p for p in product((-1.0, 0.0, 1.0), repeat=3) if sum(map(abs, p)) in (0.0, 1.0, 3.0)])


@nb.njit(cache=True)
def _nearest_in_box(points_m: Float, centre_m: Float, rotation: Float, half_m: Float, out: Float) -> None:
    """Write the points of a box nearest to points (N, 3) to `out`."""
    for n in range(points_m.shape[0]):
        for axis in range(3):
            out[n, axis] = centre_m[axis]
        for column in range(3):
            along = 0.0
            for axis in range(3):
                along += rotation[axis, column] * (points_m[n, axis] - centre_m[axis])
            along = min(max(along, -half_m[column]), half_m[column])
            for axis in range(3):
                out[n, axis] += along * rotation[axis, column]


@nb.njit(cache=True)
def _slide(displacement: Float, velocity: Float, normal: Float, least: Float, carried: Float) -> None:
    """Project a displacement (3,) on {d . n_i >= least_i} and the velocity (3,) on the active ones.

    A half-space of velocities is {v . n_i >= carried_i}. At a fixed surface it holds 0, so that
    no projection on one adds speed; a mover carries its own speed along the normal.
    """
    for _ in range(40):
        for i in range(normal.shape[0]):
            short = least[i] - (
                normal[i, 0] * displacement[0]
                + normal[i, 1] * displacement[1]
                + normal[i, 2] * displacement[2]
            )
            if short > 0.0:
                for axis in range(3):
                    displacement[axis] += short * normal[i, axis]
    for _ in range(40):
        for i in range(normal.shape[0]):
            room, into = -least[i], -carried[i]
            for axis in range(3):
                room += normal[i, axis] * displacement[axis]
                into += normal[i, axis] * velocity[axis]
            if room < 0.1 * _SKIN_M and into < 0.0:
                for axis in range(3):
                    velocity[axis] -= into * normal[i, axis]


class _Planes(NamedTuple):
    """Planes that had the box on one side at the begin of a step."""

    normal: Float  # (N, 3) to the box
    gap: Float  # (N,) m
    moved: Float  # (N,) displacement along the normal in this step, m
    carried: Float  # (N,) speed along the normal, m/s


def _mover_planes(before: State, movers: Bodies, moved_m: Float, half_m: Float, within_m: float) -> _Planes:
    """Planes between the box at the begin of a step and the movers, (B, 3) of whose way lies in it."""
    begin = replace(movers, position_m=movers.position_m - moved_m)
    rotation = rotation_from_quaternion(before.quaternion_wxyz)
    index, normal, gap = separating_planes(begin, before.position_m, rotation, half_m, within_m)
    moved = np.sum(normal * moved_m[index], axis=1)
    carried = np.sum(normal * movers.velocity_mps[index], axis=1)
    return _Planes(normal, gap, moved, carried)


def _near_places(
    scene: Scene, centre_m: Float, rotation: Float, half_m: Float
) -> Iterator[tuple[Float, Float]]:
    """Scene points (N, 3) locally nearest to a free box, unit normals (N, 3) to the box; best guess first.

    A very small gap has hardly a direction in float32. The first guess takes that direction
    from a smaller box inside, which is exact but where a corner of the scene meets the rim
    of a face; the second from the box itself.
    """
    point, across = _search(scene, centre_m, rotation, half_m)
    small = np.linalg.norm(across, axis=1) < _LEAST_GAP_M
    if small.any():
        inner_point, inner_across = _search(scene, centre_m, rotation, half_m - _CORE * half_m.min())
        yield _planes(
            np.where(small[:, None], inner_point, point), np.where(small[:, None], inner_across, across)
        )
    yield _planes(point, across)


def _planes(point: Float, across: Float) -> tuple[Float, Float]:
    """Points and unit normals, without those that have no direction (the box overlapped before)."""
    gap = np.linalg.norm(across, axis=1)
    apart = gap > 1e-6
    return point[apart], across[apart] / gap[apart, None]


def _search(scene: Scene, centre_m: Float, rotation: Float, half_m: Float) -> tuple[Float, Float]:
    """Scene points (N, 3) locally nearest to a box, and the ways (N, 3) from them to the box."""
    inside = centre_m + (_STARTS * half_m) @ rotation.T
    for _ in range(_ROUNDS):
        outside = scene.fixed_closest_point_m(inside)
        _nearest_in_box(outside, centre_m, rotation, half_m, inside)
    outside = scene.fixed_closest_point_m(inside)
    return outside, inside - outside


def between(before: State, after: State, share: float) -> State:
    """`after` with the pose at a share of the way from `before`."""
    a, b = before.quaternion_wxyz, after.quaternion_wxyz
    q = a + share * ((b if float(a @ b) >= 0.0 else -b) - a)
    return replace(
        after,
        position_m=before.position_m + share * (after.position_m - before.position_m),
        quaternion_wxyz=q / np.linalg.norm(q),
    )


def _touches(state: State, scene: Scene, size_m: Float, margin_m: float = 0.0) -> bool:
    return scene.touches(state.position_m, rotation_from_quaternion(state.quaternion_wxyz), size_m, margin_m)


def _touches_fixed(state: State, scene: Scene, size_m: Float) -> bool:
    return scene.touches_fixed(state.position_m, rotation_from_quaternion(state.quaternion_wxyz), size_m)


def stopped(before: State, after: State, scene: Scene, size_m: Float, moved_m: Float) -> State:
    """Return where the motion from free `before` to touching `after` ends: free, slid along the surface."""
    rotation = rotation_from_quaternion(after.quaternion_wxyz)
    start_rotation = rotation_from_quaternion(before.quaternion_wxyz)
    way = after.position_m - before.position_m
    within_m = float(np.linalg.norm(way) + np.linalg.norm(moved_m, axis=1).max(initial=0.0)) + 2.0 * _SKIN_M
    movers = _mover_planes(before, scene.bodies, moved_m, 0.5 * size_m, within_m)
    guesses = []
    for point, normal in _near_places(scene, before.position_m, start_rotation, 0.5 * size_m):
        reach, start_reach = (np.abs(normal @ r) @ (0.5 * size_m) for r in (rotation, start_rotation))
        gap = np.sum(normal * (before.position_m - point), axis=1) - start_reach
        # where the plane cuts a corner of the box, it may not come nearer: nothing pushes it off
        least = reach - start_reach + np.where(gap > 0.0, _SKIN_M - gap, 0.0)
        displacement, velocity = way.copy(), after.velocity_mps.copy()
        carried = np.zeros(least.shape[0])
        if len(
            movers.gap
        ):  # before the fixed surfaces: of two that contradict each other, the last one holds
            turned = np.abs(movers.normal @ rotation) - np.abs(movers.normal @ start_rotation)
            pushed = np.minimum(_SKIN_M - movers.gap, _PUSH_OUT_M) + movers.moved
            normal = np.concatenate([movers.normal, normal])
            least = np.concatenate([turned @ (0.5 * size_m) + pushed, least])
            carried = np.concatenate([movers.carried, carried])
        _slide(displacement, velocity, normal, least, carried)
        slid = replace(after, position_m=before.position_m + displacement, velocity_mps=velocity)
        if not _touches(slid, scene, size_m):
            return slid
        guesses.append(slid)
    shorter = [between(before, slid, share) for share in (0.5, 0.25, 0.125) for slid in guesses]
    for end in shorter:
        if not _touches(end, scene, size_m):
            return end
    if len(scene.bodies):
        for end in (*guesses, *shorter):
            if not _touches_fixed(end, scene, size_m):
                return end
    return replace(before, velocity_mps=np.zeros(3), body_rate_radps=np.zeros(3))

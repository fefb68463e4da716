"""Inelastic contact of the yawed and tilted body box with true geometry.

The velocity into a surface is lost, the rest slides along; the box never passes through
and never ends overlapping when it began free. [ours]: paper 1 counts contacts and does not
say what they do to the flight.

Method: the body at the begin of the step is free, so at a place where box and scene are
locally nearest, found by projecting to and fro between the two, the plane through the
scene's point across the gap has the box on one side. The box at the end of the step must
stay on that side: half-spaces for the displacement (through the reach of the turned box,
which pushes it off when it turns against a wall) and for the velocity. Both are projected
on them. An exact test of the outcome decides; what still touches is cut short, down to the
pose before at rest.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from itertools import product
from typing import TYPE_CHECKING

import numba as nb
import numpy as np

from uavexp.geometry import rotation_from_quaternion
from uavexp.types import Contact, Float, State

if TYPE_CHECKING:
    from uavexp.scene import Scene

_SKIN_M = 1e-3  # gap left after a contact: points of the scene are float32
_LEAST_GAP_M = 5e-3  # below it, the direction across the gap is off by a thousandth or more
_CORE = 0.3  # depth of the inner box under the faces, as a share of the smallest half size
_ROUNDS = 6  # of projections between box and scene
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
def _slide(displacement: Float, velocity: Float, normal: Float, least: Float) -> None:
    """Project a displacement (3,) on {d . n_i >= least_i} and the velocity (3,) on the active ones.

    Each half-space of velocities holds 0, so that no projection on one adds speed.
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
            room, into = -least[i], 0.0
            for axis in range(3):
                room += normal[i, axis] * displacement[axis]
                into += normal[i, axis] * velocity[axis]
            if room < 0.1 * _SKIN_M and into < 0.0:
                for axis in range(3):
                    velocity[axis] -= into * normal[i, axis]


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
        outside = scene.closest_point_m(inside)
        _nearest_in_box(outside, centre_m, rotation, half_m, inside)
    outside = scene.closest_point_m(inside)
    return outside, inside - outside


def _between(before: State, after: State, share: float) -> State:
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


def _stopped(before: State, after: State, scene: Scene, size_m: Float) -> State:
    """Return where the motion from free `before` to touching `after` ends: free, slid along the surface."""
    rotation = rotation_from_quaternion(after.quaternion_wxyz)
    start_rotation = rotation_from_quaternion(before.quaternion_wxyz)
    guesses = []
    for point, normal in _near_places(scene, before.position_m, start_rotation, 0.5 * size_m):
        reach, start_reach = (np.abs(normal @ r) @ (0.5 * size_m) for r in (rotation, start_rotation))
        gap = np.sum(normal * (before.position_m - point), axis=1) - start_reach
        # where the plane cuts a corner of the box, it may not come nearer: nothing pushes it off
        least = reach - start_reach + np.where(gap > 0.0, _SKIN_M - gap, 0.0)
        displacement, velocity = after.position_m - before.position_m, after.velocity_mps.copy()
        _slide(displacement, velocity, normal, least)
        slid = replace(after, position_m=before.position_m + displacement, velocity_mps=velocity)
        if not _touches(slid, scene, size_m):
            return slid
        guesses.append(slid)
    for share in (0.5, 0.25, 0.125):
        for slid in guesses:
            end = _between(before, slid, share)
            if not _touches(end, scene, size_m):
                return end
    return replace(before, velocity_mps=np.zeros(3), body_rate_radps=np.zeros(3))


def resolve(
    before: State, after: State, scene: Scene, body_size_m: tuple[float, float, float]
) -> tuple[State, bool]:
    """Let true geometry stop the motion from `before` to `after`.

    Args:
        before: free state at the begin of the step.
        after: state at its end had there been nothing in the way.
        scene: the true geometry.
        body_size_m: length, width, height of the box.

    Returns:
        The state at the end of the step, and whether the box touched. It is `after` itself
        when it did not; otherwise free of overlap provided that `before` was, and not faster.
    """
    size = np.array(body_size_m)
    travel = float(np.linalg.norm(after.position_m - before.position_m))
    # no surface fits between two boxes less than half a box apart
    pieces = max(1, int(np.ceil(travel / (0.5 * min(body_size_m)))))
    start = before
    for piece in range(1, pieces + 1):
        end = after if piece == pieces else _between(before, after, piece / pieces)
        if _touches(end, scene, size):
            return _stopped(start, end, scene, size), True
        start = end
    return after, False


@dataclass(slots=True, kw_only=True)
class ContactTracker:
    """Resolves every step of a flight and counts each contact once, until it has ended.

    A contact begins with a touch and is over when the gap has exceeded `release_gap_m` for
    `release_time_s`; its end is the last moment within that gap. Far from surfaces a step
    costs nothing: distance is 1-Lipschitz, so a clearance measured once is a lower bound
    for the clearance nearby.
    """

    scene: Scene
    body_size_m: tuple[float, float, float]
    release_gap_m: float = 0.02
    release_time_s: float = 0.2
    _measured_at_m: Float = field(init=False, repr=False)
    _clearance_m: float = field(init=False, repr=False, default=-1.0)
    _open: Contact | None = field(init=False, repr=False, default=None)
    _closed: list[Contact] = field(init=False, repr=False, default_factory=list)

    def advance(self, before: State, after: State, time_s: float) -> tuple[State, bool]:
        """Resolve the step that ends at `time_s`; see `resolve`."""
        if self._open is None and self._is_far(before, after):
            return after, False
        state, touched = resolve(before, after, self.scene, self.body_size_m)
        if touched and self._open is None:
            self._open = Contact(start_s=time_s, end_s=time_s, position_m=state.position_m.copy())
        if self._open is not None:
            if touched or _touches(state, self.scene, np.array(self.body_size_m), self.release_gap_m):
                self._open = replace(self._open, end_s=time_s)
            elif time_s - self._open.end_s > self.release_time_s:
                self._closed.append(self._open)
                self._open = None
        return state, touched

    @property
    def contacts(self) -> tuple[Contact, ...]:
        """All contacts so far, the one still open included."""
        return (*self._closed, *(() if self._open is None else (self._open,)))

    def _is_far(self, before: State, after: State) -> bool:
        """Whether no part of the box can meet a surface on the way."""
        reach = 0.5 * float(np.linalg.norm(self.body_size_m))
        if self._clearance_m > reach:
            gone = after.position_m - self._measured_at_m
            if self._clearance_m - float(np.sqrt(gone @ gone)) > reach:
                return True
        self._measured_at_m = after.position_m
        self._clearance_m = float(self.scene.distance_m(after.position_m[None])[0])
        travel = float(np.linalg.norm(after.position_m - before.position_m))
        return self._clearance_m - travel > reach

"""Inelastic contact of the yawed and tilted body box with true geometry, fixed or moving.

The velocity into a surface is lost, the rest slides along; the box never passes through
and never ends overlapping when it began free (`slide` says how). [ours]: paper 1 counts
contacts and does not say what they do to the flight.

With a mover the velocity is lost relative to it: one that runs into the vehicle pushes it
along, and is itself not held up. One that presses the vehicle against a wall goes through
it: the overlap is accepted, and the vehicle is let out of the mover by at most 1 cm a step.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from uavexp.arrays import Float
from uavexp.bodies import distance_m
from uavexp.geometry import rotation_from_quaternion
from uavexp.log import Contact
from uavexp.types import Bodies, State
from uavexp.vehicle.slide import between, stopped

if TYPE_CHECKING:
    from uavexp.scene import Scene

_JUMP_M = 1.0  # in one step: no motion, the mover appears or leaves
FIXED = -1  # in place of a mover's index: fixed surfaces


def _partners(state: State, scene: Scene, size_m: Float, margin_m: float = 0.0) -> tuple[int, ...]:
    """What the box touches: `FIXED` first, then indices of movers."""
    rotation = rotation_from_quaternion(state.quaternion_wxyz)
    fixed = scene.touches_fixed(state.position_m, rotation, size_m, margin_m)
    movers: list[int] = []
    if len(scene.bodies):
        movers = scene.touched_movers(state.position_m, rotation, size_m, margin_m).tolist()
    return ((FIXED,) if fixed else ()) + tuple(movers)


def resolve(
    before: State,
    after: State,
    scene: Scene,
    body_size_m: tuple[float, float, float],
    moved_m: Float | None = None,
) -> tuple[State, tuple[int, ...]]:
    """Let true geometry stop the motion from `before` to `after`.

    Args:
        before: free state at the begin of the step.
        after: state at its end had there been nothing in the way.
        scene: the true geometry, its movers where they are at the end of the step.
        body_size_m: length, width, height of the box.
        moved_m: (B, 3) how far each mover has come in the step; None: not at all.

    Returns:
        The state at the end of the step, and what the box would have met: `FIXED` and indices of
        movers; empty: nothing. The state is `after` itself when it met nothing; otherwise free of
        overlap provided that `before` was and that no mover squeezes it, and not faster, unless
        a mover pushes it.
    """
    size = np.array(body_size_m)
    moved_m = np.zeros((len(scene.bodies), 3)) if moved_m is None else moved_m
    travel = float(np.linalg.norm(after.position_m - before.position_m))
    # no surface fits between two boxes less than half a box apart
    pieces = max(1, int(np.ceil(travel / (0.5 * min(body_size_m)))))
    start = before
    for piece in range(1, pieces + 1):
        end = after if piece == pieces else between(before, after, piece / pieces)
        partners = _partners(end, scene, size)
        if partners:
            return stopped(start, end, scene, size, moved_m), partners
        start = end
    return after, ()


@dataclass(slots=True, kw_only=True)
class ContactTracker:
    """Resolves every step of a flight and counts each contact once, until it has ended.

    Fixed surfaces together and each mover for itself are one partner. A contact begins with a
    touch and is over when the gap has exceeded `release_gap_m` for `release_time_s`; its end is
    the last moment within that gap. Far from surfaces a step costs nothing: distance is
    1-Lipschitz, so a clearance measured once is a lower bound for the clearance nearby. Movers
    are asked every step, for they come by themselves.
    """

    scene: Scene
    body_size_m: tuple[float, float, float]
    release_gap_m: float = 0.02
    release_time_s: float = 0.2
    _reach_m: float = field(init=False, repr=False)  # from the centre to a corner
    _measured_at_m: Float = field(init=False, repr=False, default_factory=lambda: np.zeros(3))
    _clearance_m: float = field(init=False, repr=False, default=-1.0)
    _movers: Bodies = field(init=False, repr=False, default_factory=Bodies.none)  # a step ago
    _open: dict[int, Contact] = field(init=False, repr=False, default_factory=dict)
    _closed: list[Contact] = field(init=False, repr=False, default_factory=list)

    def __post_init__(self) -> None:
        self._reach_m = 0.5 * float(np.linalg.norm(self.body_size_m))

    def advance(self, before: State, after: State, time_s: float) -> tuple[State, bool]:
        """Resolve the step that ends at `time_s`, where the scene's movers are by now; see `resolve`."""
        movers, moved_m = self.scene.bodies, self._moved_m()
        self._movers = movers
        if not self._open and self._is_far(before, after, moved_m):
            return after, False
        state, partners = resolve(before, after, self.scene, self.body_size_m, moved_m)
        for partner in partners:
            if partner not in self._open:
                self._open[partner] = Contact(
                    start_s=time_s, end_s=time_s, position_m=state.position_m.copy(), mover=partner
                )
        if self._open:
            self._release(state, partners, time_s)
        return state, bool(partners)

    @property
    def contacts(self) -> tuple[Contact, ...]:
        """All contacts so far, those still open included."""
        return (*self._closed, *self._open.values())

    @property
    def free_ball(self) -> tuple[Float, float]:
        """Centre (3,) and radius of a ball in which the body, wherever its centre, meets no fixed surface."""
        return self._measured_at_m, -1.0 if self._open else self._clearance_m - self._reach_m

    def _moved_m(self) -> Float:
        """How far each mover has come since the last step (B, 3); 0 for one that appears or leaves."""
        now, then = self.scene.bodies.position_m, self._movers.position_m
        if now is then or now.shape != then.shape:
            return np.zeros(now.shape)
        moved_m = now - then
        moved_m[np.abs(moved_m).max(axis=1) > _JUMP_M] = 0.0
        return moved_m

    def _release(self, state: State, partners: tuple[int, ...], time_s: float) -> None:
        """Prolong the open contacts that still hold, close those that have ended."""
        near = _partners(state, self.scene, np.array(self.body_size_m), self.release_gap_m)
        for partner, contact in list(self._open.items()):
            if partner in partners or partner in near:
                self._open[partner] = replace(contact, end_s=time_s)
            elif time_s - contact.end_s > self.release_time_s:
                self._closed.append(self._open.pop(partner))

    def _is_far(self, before: State, after: State, moved_m: Float) -> bool:
        """Whether no part of the box can meet a surface or a mover on the way."""
        travel_m = float(np.linalg.norm(after.position_m - before.position_m))
        if len(moved_m):
            way_m = travel_m + float(np.abs(moved_m).sum())
            if distance_m(self.scene.bodies, after.position_m[None])[0] <= self._reach_m + way_m:
                return False
        centre_m, radius_m = self.free_ball
        gone_m = after.position_m - centre_m
        if float(np.sqrt(gone_m @ gone_m)) < radius_m:
            return True
        self._measured_at_m = after.position_m
        self._clearance_m = float(self.scene.fixed_distance_m(after.position_m[None])[0])
        return travel_m < self.free_ball[1]

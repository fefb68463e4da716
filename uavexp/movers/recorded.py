"""Real people: recorded tracks, placed in a room as upright cylinders.

Rows of a file may stand in any order; one that stands there twice counts once, and whoever is in two
places at one time is refused (`track_files`).

The recording is turned by a quarter turn, shifted and cut out of its own time, each drawn from
the seed unless given. The area that the tracks cover is laid into the flight area where it is
the smaller one; where it is the larger one it covers the flight area, and people are absent
while they are outside. Between two samples a person goes along a cubic with the velocities of
the neighbouring samples (Catmull-Rom); over a gap of more than `longest_gap_s` the person is
absent. So is a person wherever there is no room: over no free air that is joined with the start,
or with the cylinder in a fixed surface. Whoever is ever faster than the vehicle, or within its
stopping distance of the start in the first `settled_s`, is left out altogether. Recorded people
do not react: they may come near to each other, and one may appear in the middle of a room.
After `duration_s` the recording begins anew.
"""

from __future__ import annotations

import math
from dataclasses import field
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from uavexp.arrays import Bool, Float
from uavexp.bodies import ABSENT_M
from uavexp.errors import WorldError
from uavexp.movers import track_files
from uavexp.movers.placing import FLOOR_GAP_M, Air
from uavexp.movers.timeline import ROW_S, Timeline, row_of
from uavexp.parameters import Constraint, Finite, NonNegative, Positive, between, option
from uavexp.scene import Scene
from uavexp.types import Bodies, Limits, Shape, World

_TEST_ROWS = 10  # between the places that are tested for room


@option
class Recorded:
    """Recorded tracks of people, at true speed unless scaled."""

    path: Annotated[str, Constraint("the name of a file of tracks", bool)]  # csv with columns t_s, id,
    # x_m, y_m (s, a name, m, m) or frame, id, x, y; txt of PedPy or obsmat; TrajNet++ ndjson; JuPedSim sqlite
    unit_m: Positive | None = None  # m, length of one unit of the file; null: as it says, or 1 m
    frame_rate_hz: Positive | None = None  # Hz, of a file that counts frames; null: as it says
    scale: Positive = 1.0  # of the recorded places; below 1 people are slower too [ours]
    begin_s: Finite | None = None  # s, of the recording's own clock, where the flight begins;
    # null: by seed [ours]
    quarter_turns: Literal[0, 1, 2, 3] | None = None  # 0 | 1 | 2 | 3, how the recording is turned;
    # null: by seed [ours]
    duration_s: Annotated[float, between(ROW_S, 3600)] = 120.0  # s of the recording, after which it
    # begins anew [ours]
    longest_gap_s: Positive = 1.0  # s; a longer gap between two samples is not bridged:
    # the person is absent [ours]
    radius_m: Positive = 0.25  # m, of a person [ours]
    height_m: Positive = 1.7  # m, of a person [ours]
    start_margin_m: NonNegative = 0.75  # m beyond the vehicle's stopping distance within which nobody
    # is at first [ours]
    settled_s: NonNegative = 3.0  # s, how long "at first" is: hovering,
    # planning and turning before the vehicle goes [ours]
    _timeline: Timeline = field(init=False, repr=False)

    def reset(self, world: World, scene: Scene, limits: Limits, rng: np.random.Generator) -> None:
        """Begin a trial: place the recording in the room.

        Raises:
            WorldError: the file is bad, or nobody is in it at the time chosen.
        """
        given = track_files.Options(unit_m=self.unit_m, frame_rate_hz=self.frame_rate_hz)
        tracks = list(track_files.read(Path(self.path), given).values())
        turn, late, *shift = rng.random(4)
        first_s, last_s = min(t[0, 0] for t in tracks), max(t[-1, 0] for t in tracks)
        spare_s = max(0.0, last_s - first_s - self.duration_s)
        begin_s = first_s + late * spare_s if self.begin_s is None else self.begin_s
        turns = int(4.0 * turn) if self.quarter_turns is None else self.quarter_turns
        c, s = ((1, 0), (0, 1), (-1, 0), (0, -1))[turns]
        rotation = self.scale * np.array([[c, -s], [s, c]], dtype=np.float64)
        everywhere = np.concatenate([track[:, 1:] for track in tracks]) @ rotation.T
        low, high = everywhere.min(axis=0), everywhere.max(axis=0)
        room_low, room_high = world.flight_bounds_m[:, :2]
        # between flush with one side and flush with the other, whichever of the two is the larger
        offset = (room_low - low) + np.array(shift) * ((room_high - high) - (room_low - low))
        rows = row_of(self.duration_s)
        times_s: Float = begin_s + ROW_S * np.arange(rows, dtype=np.float64)
        air = Air(world, scene)
        level_m = float(air.floor_m(world.start_m[None, :2])[0]) + 0.5 * self.height_m + FLOOR_GAP_M
        people = []
        for track in tracks:
            if track[-1, 0] < times_s[0] or track[0, 0] > times_s[-1]:
                continue
            placed = np.column_stack([track[:, 0], track[:, 1:] @ rotation.T + offset])
            walk = _walk(placed, times_s, self.longest_gap_s)
            if walk is None or not self._is_avoidable(*walk, world, limits):
                continue
            position, velocity, there = walk
            there &= self._has_room(position, there, level_m, air, scene, world)
            if there.any():
                people.append((position, velocity, there))
        if not people:
            raise WorldError(
                f"movers: nobody of {self.path} is in the room from {begin_s:g} s to {times_s[-1]:g} s"
            )
        self._timeline = self._lay_out(people, level_m)

    def at(self, time_s: float) -> Bodies:
        """The people at a time >= 0; those who are not there are at `bodies.ABSENT_M`."""
        again_s = self._timeline.position_m.shape[0] * ROW_S
        return self._timeline.at(time_s, math.fmod(time_s + 1e-9, again_s))

    def _is_avoidable(
        self, position: Float, velocity: Float, there: Bool, world: World, limits: Limits
    ) -> bool:
        """Whether a person is never too fast, nor near the start while the vehicle still stands."""
        keep_m = limits.max_speed_mps**2 / (2.0 * limits.max_acceleration_mps2) + limits.body_radius_m
        speed = np.linalg.norm(velocity, axis=1)
        soon = np.arange(len(there)) * ROW_S < self.settled_s
        away_m = np.linalg.norm(position - world.start_m[:2], axis=1) - self.radius_m
        near = there & soon & (away_m < keep_m + self.start_margin_m)
        return not near.any() and not bool((speed[there] > limits.max_speed_mps).any())

    def _has_room(
        self, position: Float, there: Bool, level_m: float, air: Air, scene: Scene, world: World
    ) -> Bool:
        """Where a person fits in (K,): judged at every tenth row, a tenth of a second for those around it."""
        half = np.array([self.radius_m, self.radius_m, 0.5 * self.height_m])
        low, high = world.flight_bounds_m[:, :2]
        tested = position[::_TEST_ROWS]
        free = there[::_TEST_ROWS] & ((tested >= low) & (tested <= high)).all(axis=1)
        free[free] = air.near_layer(tested[free])
        for n in np.flatnonzero(free):
            centre = np.array([*tested[n], level_m])
            free[n] = not scene.touches_fixed(centre, np.eye(3), 2.0 * half)
        # a row is free when the tested places before and after it are
        after = np.append(free[1:], free[-1])
        return np.repeat(free & after, _TEST_ROWS)[: len(there)]

    def _lay_out(self, people: list[tuple[Float, Float, Bool]], level_m: float) -> Timeline:
        """Rows of all people (K, B, 3)."""
        rows, count = len(people[0][2]), len(people)
        position = np.tile(ABSENT_M, (rows, count, 1))
        velocity = np.zeros((rows, count, 3))
        for b, (walked, speed, there) in enumerate(people):
            position[there, b] = np.column_stack([walked[there], np.full(there.sum(), level_m)])
            velocity[there, b, :2] = speed[there]
        half = np.array([self.radius_m, self.radius_m, 0.5 * self.height_m])
        return Timeline(
            np.full(count, Shape.CYLINDER, np.uint8), np.tile(half, (count, 1)), position, velocity
        )


def _walk(track: Float, times_s: Float, longest_gap_s: float) -> tuple[Float, Float, Bool] | None:
    """Positions and velocities (K, 2) along a track (N, 3) at times (K,), and whether there; None: never."""
    own_s = track[:, 0]
    position, velocity = np.zeros((len(times_s), 2)), np.zeros((len(times_s), 2))
    there = np.zeros(len(times_s), dtype=bool)
    breaks = np.flatnonzero(np.diff(own_s) > longest_gap_s) + 1
    for part in np.split(np.arange(len(own_s)), breaks):
        inside = (times_s >= own_s[part[0]]) & (times_s <= own_s[part[-1]])
        if len(part) < 2 or not inside.any():
            continue
        slope = np.gradient(track[part, 1:], own_s[part], axis=0)
        curve = CubicHermiteSpline(own_s[part], track[part, 1:], slope)
        position[inside], velocity[inside] = curve(times_s[inside]), curve(times_s[inside], 1)
        there |= inside
    return (position, velocity, there) if there.any() else None

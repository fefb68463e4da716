"""Movers of several shapes and sizes that move in several ways, all drawn from the seed.

Spheres fly, people (upright cylinders) and boxes stand on the floor; `motion` says how they
move. Every number is drawn before the flight. Blind ones react to nothing but walls; social ones
(`social`) want to move in the same way, and make way for walls, for one another and for the vehicle, which
they see ten times a second. A mover is placed
on air that is joined with the start, where its box meets no surface (so none starts inside a
wall or on the far side of one), apart from all others, and no nearer to the start than the
vehicle's stopping distance v^2 / (2 a) plus `start_margin_m`, surface to surface.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import field
from enum import StrEnum
from typing import Annotated

import numpy as np

from uavexp.arrays import Float, UInt8
from uavexp.errors import WorldError, require
from uavexp.movers.motion import POSITION, REST, WAY, Mode, advance, is_blocked
from uavexp.movers.placing import Air
from uavexp.movers.social import advance_among, desired_mps
from uavexp.movers.timeline import Timeline, row_of
from uavexp.parameters import NonNegative, Positive, PositiveShare, Range, Share, between, option
from uavexp.scene import Scene
from uavexp.types import Bodies, Limits, Shape, World

_CHUNK = 1000  # rows made at once
_ATTEMPTS = 300  # drawings of a mover before giving up
_LOOK = 10  # rows from one look around to the next
_CIRCLE_STEP_M = 0.05  # between the places of a circle that are tested


class Reaction(StrEnum):
    """Whether movers look where they go."""

    BLIND = "blind"
    SOCIAL = "social"


@option
class Mixed:
    """Linear, circular and accelerated movers: spheres, people and boxes."""

    count: Annotated[int, between(1, 200)] = 8  # movers; issue: "the closed loop with 8 movers" [ours]
    speed_mps: Range = (0.4, 1.5)  # m/s, least and greatest speed; a brisk walk,
    # well below the vehicle's 2.5 m/s [ours]
    linear_share: Share = 0.5  # of movers that go straight and rebound, damped [ours]
    circular_share: Share = 0.25  # of movers on a circle; the rest go straight with changing speed [ours]
    sphere_share: Share = 0.3  # of flying spheres [ours]
    person_share: Share = 0.4  # of people, upright cylinders; the rest are boxes on the floor [ours]
    sphere_radius_m: Range = (0.15, 0.35)  # m [ours]
    person_radius_m: Range = (0.22, 0.30)  # m [ours]
    person_height_m: Positive = 1.7  # m [ours]
    box_width_m: Range = (0.3, 0.8)  # m, of each side [ours]
    box_height_m: Range = (0.8, 1.8)  # m [ours]
    circle_radius_m: Range = (0.6, 2.0)  # m [ours]
    period_s: Range = (2.0, 5.0)  # s, of the speed of accelerated movers [ours]
    restitution: PositiveShare = 0.9  # share of its speed into a surface that a linear mover keeps;
    # paper 2: "damped" [ours]
    start_margin_m: NonNegative = 0.75  # m beyond the vehicle's stopping distance that no mover
    # starts within [ours]
    reaction: Reaction = Reaction.BLIND  # blind (paper 2) | social: make way for walls, one another and the
    # vehicle, by the social force of Moussaïd et al. 2009 [ours]
    _scene: Scene = field(init=False, repr=False)
    _bounds_m: tuple[Float, Float] = field(init=False, repr=False)  # (B, 3) of the centres, each
    _mode: UInt8 = field(init=False, repr=False)
    _state: Float = field(init=False, repr=False)
    _motion: Float = field(init=False, repr=False)  # (B, 3) velocities of social ones
    _vehicle: Float = field(init=False, repr=False)  # (7,) position, velocity, radius; NaN: not seen
    _timeline: Timeline = field(init=False, repr=False)
    _rows: int = field(init=False, repr=False, default=0)  # of the timeline that are made

    def __post_init__(self) -> None:
        for one, other in (("linear_share", "circular_share"), ("sphere_share", "person_share")):
            sum_ = getattr(self, one) + getattr(self, other)
            require(sum_ <= 1.0 + 1e-9, f"{one} and {other} must have a sum <= 1, got {sum_:g}")

    def reset(self, world: World, scene: Scene, limits: Limits, rng: np.random.Generator) -> None:
        """Begin a trial: draw all movers.

        Raises:
            ConfigError: a mover could be faster than the vehicle.
            WorldError: the movers do not fit in.
        """
        require(
            self.speed_mps[1] <= limits.max_speed_mps,
            f"movers.speed_mps must be at most the vehicle's {limits.max_speed_mps:g} m/s, "
            f"got {self.speed_mps[1]:g}",
        )
        air = Air(world, scene)
        keep_m = limits.max_speed_mps**2 / (2.0 * limits.max_acceleration_mps2) + limits.body_radius_m
        low, high = np.empty((self.count, 3)), np.empty((self.count, 3))
        shape, mode = np.empty(self.count, np.uint8), np.empty(self.count, np.uint8)
        half, state = np.empty((self.count, 3)), np.zeros((self.count, 10))
        for b in range(self.count):
            for _ in range(_ATTEMPTS):
                shape[b], half[b] = self._draw_body(rng)
                state[b, POSITION] = centre = air.draw(rng, half[b], stands=shape[b] != Shape.SPHERE)
                low[b], high[b] = air.bounds_m(half[b], centre, stands=shape[b] != Shape.SPHERE)
                mode[b] = self._draw_motion(rng, state[b], flies=shape[b] == Shape.SPHERE)
                apart = np.linalg.norm(state[:b, :2] - centre[:2], axis=1) > np.linalg.norm(
                    half[:b, :2], axis=1
                ) + np.linalg.norm(half[b, :2])
                away = math.dist(centre[:2], world.start_m[:2]) - float(np.linalg.norm(half[b, :2]))
                if (
                    away > keep_m + self.start_margin_m
                    and apart.all()
                    and air.holds(centre, half[b])
                    and self._fits(scene, low[b], high[b], half[b], mode[b], state[b])
                ):
                    break
            else:
                message = (
                    f"movers: no room for number {b + 1} of {self.count} after {_ATTEMPTS} drawings; "
                    "fewer or smaller ones, or a smaller start_margin_m"
                )
                raise WorldError(message)
        self._scene, self._bounds_m, self._mode, self._state = scene, (low, high), mode, state
        self._motion = np.array([desired_mps(int(m), s, 0.0) for m, s in zip(mode, state, strict=True)])
        self._vehicle = np.append(np.full(6, np.nan), limits.body_radius_m)
        nothing = np.empty((0, self.count, 3))
        self._timeline, self._rows = Timeline(shape, half, nothing, nothing), 0

    def notice(self, position_m: Float, velocity_mps: Float) -> None:
        """Where the vehicle is by now, position (3,) and velocity (3,): what social movers look at."""
        self._vehicle[:3], self._vehicle[3:6] = position_m, velocity_mps

    def at(self, time_s: float) -> Bodies:
        """The bodies at a time >= 0; rows are made in chunks as they are asked for."""
        while row_of(time_s) >= self._rows:
            self._go_on()
        return self._timeline.at(time_s, time_s)

    def _go_on(self) -> None:
        """Make more rows."""
        shape, half, position, velocity = self._timeline
        if self._rows == len(position):
            more = np.empty((_CHUNK, self.count, 3))
            position, velocity = np.concatenate([position, more]), np.concatenate([velocity, more])
            self._timeline = Timeline(shape, half, position, velocity)
        blind = self.reaction is Reaction.BLIND
        first, end = self._rows, self._rows + (_CHUNK if blind else _LOOK)
        grid, to_write = self._scene.grid, (first, position[first:end], velocity[first:end])
        if blind:
            advance(grid, *self._bounds_m, self._mode, half, self.restitution, self._state, *to_write)
        else:
            wall_m = self._scene.fixed_closest_point_m(self._state[:, POSITION])
            advance_among(
                grid, *self._bounds_m, self._mode, half, self.speed_mps[1], self._state, self._motion,
                wall_m, self._vehicle, *to_write,
            )  # fmt: skip
        self._rows = end

    def _draw_body(self, rng: np.random.Generator) -> tuple[Shape, Float]:
        """Draw a shape and its half size (3,)."""
        kind, size, height = rng.random(), rng.random(2), rng.random()
        if kind < self.sphere_share:
            radius = _between(self.sphere_radius_m, size[0])
            return Shape.SPHERE, np.full(3, radius)
        if kind < self.sphere_share + self.person_share:
            radius = _between(self.person_radius_m, size[0])
            return Shape.CYLINDER, np.array([radius, radius, 0.5 * self.person_height_m])
        width, depth = (_between(self.box_width_m, value) for value in size)
        return Shape.BOX, 0.5 * np.array([width, depth, _between(self.box_height_m, height)])

    def _draw_motion(self, rng: np.random.Generator, state: Float, *, flies: bool) -> Mode:
        """Draw how a body moves from its position; fills the rest of its state (10,)."""
        kind, heading, climb, turn = rng.random(4)
        slow, fast = np.sort(rng.random(2))
        speed = _between(self.speed_mps, fast)
        angle = 2.0 * math.pi * heading
        rise = math.radians(20.0) * (2.0 * climb - 1.0) if flies else 0.0
        way = np.array([math.cos(rise) * math.cos(angle), math.cos(rise) * math.sin(angle), math.sin(rise)])
        extra = rng.random(2)
        if kind < self.linear_share:
            state[WAY] = speed * way
            return Mode.LINEAR
        if kind < self.linear_share + self.circular_share:
            radius = _between(self.circle_radius_m, extra[0])
            centre = state[:2] - radius * way[:2] / np.linalg.norm(way[:2])
            state[REST] = [*centre, radius, (speed if turn < 0.5 else -speed) / radius]
            return Mode.CIRCULAR
        least = _between(self.speed_mps, slow)
        state[WAY] = way
        state[REST] = [
            0.5 * (speed + least),
            0.5 * (speed - least),
            2.0 * math.pi / _between(self.period_s, extra[0]),
            2.0 * math.pi * extra[1],
        ]
        return Mode.ACCELERATED

    @staticmethod
    def _fits(scene: Scene, low: Float, high: Float, half: Float, mode: int, state: Float) -> bool:
        """Whether a mover is clear where it starts, and on its whole circle if it has one."""
        places = state[None, POSITION]
        if mode == Mode.CIRCULAR:
            x, y, radius, _ = state[REST]
            angle = np.linspace(0.0, 2.0 * math.pi, math.ceil(2.0 * math.pi * radius / _CIRCLE_STEP_M))
            level = np.full(angle.shape, state[2])
            places = np.stack([x + radius * np.cos(angle), y + radius * np.sin(angle), level], axis=1)
        half = half + (0.5 * _CIRCLE_STEP_M if mode == Mode.CIRCULAR else 0.0) * np.array([1.0, 1.0, 0.0])
        return not any(is_blocked(scene.grid, low, high, half, place) for place in places)


def _between(limits: Sequence[float], share: float) -> float:
    return float(limits[0]) + share * (float(limits[1]) - float(limits[0]))

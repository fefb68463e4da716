"""Where the vehicle looks while it flies, holds, turns on the spot and backs up."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from uavexp.arrays import Float
from uavexp.braking import REST_MPS
from uavexp.geometry import wrap_angle
from uavexp.pilot.flown import Flown
from uavexp.pilot.following import follow
from uavexp.pilot.heading import bearing_rad
from uavexp.pilot.rules import Rules
from uavexp.trajectory import Trajectory, evaluate
from uavexp.types import Reference


@dataclass(slots=True, kw_only=True)
class Steering:
    """A yaw, turned step by step as fast as it may."""

    rules: Rules
    yaw_rad: float
    most_radps: float
    turns: bool = True  # there is room for it
    glance_rad: float = math.nan  # bearing of whom to look at besides the way; NaN: nobody

    def follow(self, flown: Flown, wanted_rad: float, times_s: Float, step_s: float) -> Float:
        """Rows (N, 14) of `following` along what is flown, the yaw turned; backwards it stays."""
        pace = (flown.pace.times_s, flown.pace.own_s, flown.pace.rate)
        most_radps = self.most_radps if self.turns and not flown.backs else 0.0
        rows: Float = follow(
            flown.trajectory.breaks_s, flown.trajectory.coefficients, pace, times_s, flown.moves_s,
            self.rules.yaw_lookahead_s, wanted_rad, self.yaw_rad, most_radps, step_s,
            self.glance_rad, self.rules.glance_rad,
        )  # fmt: skip
        self.yaw_rad = float(rows[-1, 9])
        return rows

    def first_s(self, trajectory: Trajectory, wanted_rad: float) -> float:
        """Time to turn until the camera sees where a flight from standstill goes, s.

        Sensing is what keeps the flight off unseen obstacles, under every policy alike.
        """
        times_s = trajectory.start_s + np.array([0.0, self.rules.yaw_lookahead_s])
        position, velocity, _ = evaluate(trajectory, times_s)
        bearing = bearing_rad(wanted_rad, position[1] - position[0])
        moving = float(np.linalg.norm(velocity[0])) > REST_MPS
        if moving or math.isnan(bearing) or not self.turns:
            return 0.0
        error_rad = abs(float(wrap_angle(bearing - self.yaw_rad)))
        return max(0.0, error_rad - self.rules.turn_first_rad) / self.most_radps

    def look_around(self, position_m: Float, step_s: float) -> Reference:
        """Hold and turn: without a plan, only new sights can help."""
        rate_radps = self.rules.look_around_radps if self.turns else 0.0
        self.yaw_rad = wrap_angle(self.yaw_rad + rate_radps * step_s)
        return self.hold(position_m, rate_radps)

    def hold(self, position_m: Float, yaw_rate_radps: float = 0.0) -> Reference:
        """Stand at a place (3,)."""
        zero = np.zeros(3)
        return Reference(
            position_m=position_m,
            velocity_mps=zero,
            acceleration_mps2=zero,
            yaw_rad=self.yaw_rad,
            yaw_rate_radps=yaw_rate_radps,
        )

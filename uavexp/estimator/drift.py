"""Drifting odometry: position and yaw errors that walk at bounded, correlated rates.

The error of position (world frame) and of yaw starts at zero and grows with a drift rate r,

    de/dt = r,    dr = -r dt / tau + sigma sqrt(2 / tau) dW,    |r| <= bound,

a Gauss-Markov process stepped exactly, so that its statistics do not depend on the step.
Beyond tau the error is a random walk: each position axis has the variance
2 s^2 tau (t - tau (1 - exp(-t / tau))), s = position_drift_mps / sqrt(3). The estimated
velocity and body rate are the derivatives of the estimated position and attitude, as of
an odometry that smoothly believes its own motion. [ours]: the paper names drift, no model.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from uavexp.arrays import Float
from uavexp.errors import require
from uavexp.estimator.base import Believe
from uavexp.geometry import multiply_quaternions, quaternion_from_yaw, rotation_from_quaternion
from uavexp.parameters import NonNegative, Positive, option
from uavexp.types import State


@option(frozen=True)
class Drift:
    """Random walk of position and yaw with bounded drift rates."""

    position_drift_mps: NonNegative = 0.02  # m/s, rms of the position drift rate (three axes together) [ours]
    max_position_drift_mps: NonNegative = 0.05  # m/s, largest position drift rate [ours]
    yaw_drift_radps: NonNegative = 0.002  # rad/s, rms of the yaw drift rate [ours]
    max_yaw_drift_radps: NonNegative = 0.005  # rad/s, largest yaw drift rate [ours]
    correlation_time_s: Positive = 2.0  # s, how long a drift rate lasts [ours]

    def __post_init__(self) -> None:
        for name, rms, bound in (
            ("max_position_drift_mps", self.position_drift_mps, self.max_position_drift_mps),
            ("max_yaw_drift_radps", self.yaw_drift_radps, self.max_yaw_drift_radps),
        ):
            require(bound >= rms, f"{name} must be >= the rms drift of {rms}, got {bound}")

    def begin(self, rng: np.random.Generator) -> Believe:
        """Begin a trial with no error and drift rates drawn from their steady state."""
        walk = _Walk(law=self, rng=rng)
        walk.draw_rates(0.0)
        return walk.estimate


@dataclass(slots=True, kw_only=True)
class _Walk:
    """The errors of one trial and the rates at which they grow."""

    law: Drift
    rng: np.random.Generator
    position_error_m: Float = field(default_factory=lambda: np.zeros(3))
    position_rate_mps: Float = field(default_factory=lambda: np.zeros(3))
    yaw_error_rad: float = 0.0
    yaw_rate_radps: float = 0.0

    def estimate(self, true_state: State, step_s: float) -> State:
        """Return the believed state after another `step_s` of drift."""
        self.position_error_m = self.position_error_m + step_s * self.position_rate_mps
        self.yaw_error_rad += step_s * self.yaw_rate_radps
        self.draw_rates(math.exp(-step_s / self.law.correlation_time_s))
        body_z_in_world = rotation_from_quaternion(true_state.quaternion_wxyz)[2]
        return State(
            position_m=true_state.position_m + self.position_error_m,
            velocity_mps=true_state.velocity_mps + self.position_rate_mps,
            quaternion_wxyz=multiply_quaternions(
                quaternion_from_yaw(self.yaw_error_rad), true_state.quaternion_wxyz
            ),
            body_rate_radps=true_state.body_rate_radps + self.yaw_rate_radps * body_z_in_world,
        )

    def draw_rates(self, kept: float) -> None:
        """Step both drift rates, `kept` being the share of the old rate that remains."""
        draw = self.rng.standard_normal(4)
        fresh = math.sqrt(1.0 - kept * kept)
        axis_rms = self.law.position_drift_mps / math.sqrt(3.0)
        rate = kept * self.position_rate_mps + fresh * axis_rms * draw[:3]
        speed = math.sqrt(float(rate @ rate))
        if speed > self.law.max_position_drift_mps:
            rate = rate * (self.law.max_position_drift_mps / speed)
        yaw_rate = kept * self.yaw_rate_radps + fresh * self.law.yaw_drift_radps * float(draw[3])
        self.position_rate_mps = rate
        self.yaw_rate_radps = min(max(yaw_rate, -self.law.max_yaw_drift_radps), self.law.max_yaw_drift_radps)

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
from dataclasses import field

import numpy as np

from uavexp.arrays import Float
from uavexp.errors import require
from uavexp.geometry import multiply_quaternions, quaternion_from_yaw, rotation_from_quaternion
from uavexp.parameters import NonNegative, Positive, option
from uavexp.types import State


@option
class Drift:
    """Random walk of position and yaw with bounded drift rates."""

    position_drift_mps: NonNegative = 0.02  # m/s, rms of the position drift rate (three axes together) [ours]
    max_position_drift_mps: NonNegative = 0.05  # m/s, largest position drift rate [ours]
    yaw_drift_radps: NonNegative = 0.002  # rad/s, rms of the yaw drift rate [ours]
    max_yaw_drift_radps: NonNegative = 0.005  # rad/s, largest yaw drift rate [ours]
    correlation_time_s: Positive = 2.0  # s, how long a drift rate lasts [ours]
    _rng: np.random.Generator = field(init=False, repr=False)
    _position_rate_mps: Float = field(init=False, repr=False)
    _yaw_rate_radps: float = field(init=False, repr=False)
    _position_error_m: Float = field(init=False, repr=False)
    _yaw_error_rad: float = field(init=False, repr=False)

    def __post_init__(self) -> None:
        for name, rms, bound in (
            ("max_position_drift_mps", self.position_drift_mps, self.max_position_drift_mps),
            ("max_yaw_drift_radps", self.yaw_drift_radps, self.max_yaw_drift_radps),
        ):
            require(bound >= rms, f"{name} must be >= the rms drift of {rms}, got {bound}")

    def reset(self, rng: np.random.Generator) -> None:
        """Begin a trial with no error and drift rates drawn from their steady state."""
        self._rng = rng
        self._position_error_m = np.zeros(3)
        self._yaw_error_rad = 0.0
        self._position_rate_mps = np.zeros(3)
        self._yaw_rate_radps = 0.0
        self._draw_rates(0.0)

    def estimate(self, true_state: State, step_s: float) -> State:
        """Return the believed state after another `step_s` of drift."""
        self._position_error_m = self._position_error_m + step_s * self._position_rate_mps
        self._yaw_error_rad += step_s * self._yaw_rate_radps
        self._draw_rates(math.exp(-step_s / self.correlation_time_s))
        body_z_in_world = rotation_from_quaternion(true_state.quaternion_wxyz)[2]
        return State(
            position_m=true_state.position_m + self._position_error_m,
            velocity_mps=true_state.velocity_mps + self._position_rate_mps,
            quaternion_wxyz=multiply_quaternions(
                quaternion_from_yaw(self._yaw_error_rad), true_state.quaternion_wxyz
            ),
            body_rate_radps=true_state.body_rate_radps + self._yaw_rate_radps * body_z_in_world,
        )

    def _draw_rates(self, kept: float) -> None:
        """Step both drift rates, `kept` being the share of the old rate that remains."""
        draw = self._rng.standard_normal(4)
        fresh = math.sqrt(1.0 - kept * kept)
        axis_rms = self.position_drift_mps / math.sqrt(3.0)
        rate = kept * self._position_rate_mps + fresh * axis_rms * draw[:3]
        speed = math.sqrt(float(rate @ rate))
        if speed > self.max_position_drift_mps:
            rate = rate * (self.max_position_drift_mps / speed)
        yaw_rate = kept * self._yaw_rate_radps + fresh * self.yaw_drift_radps * float(draw[3])
        self._position_rate_mps = rate
        self._yaw_rate_radps = min(max(yaw_rate, -self.max_yaw_drift_radps), self.max_yaw_drift_radps)

"""Smoothness of the flown motion: ∫‖a‖² dt and ∫‖jerk‖² dt.

Chen et al. 2026 claim smoother trajectories and define no measure. Acceleration and jerk
of the flown path are the first and second derivative of a cubic fitted by least squares
to the true velocity in a sliding window (Savitzky and Golay 1964), evaluated at its
centre, and off-centre in the first and last half window. The window is needed because
thrust is commanded in steps: the plain second difference of the velocity grows without
bound as the time step shrinks. A contact's loss of velocity is spread over the window
and stays in: hitting a wall is not smooth.
"""

from __future__ import annotations

import numpy as np

from uavexp.arrays import Float
from uavexp.log import TrialLog
from uavexp.metrics.metric import Metric, Metrics

WINDOW_S = 0.25  # short against a manoeuvre (about 1 s), long against a control step (0.01 s)
DEGREE = 3


def derivative(values: Float, step_s: float, order: int, window_s: float = WINDOW_S) -> Float:
    """Smoothed derivative of evenly sampled values, exact for cubics in time.

    Args:
        values: samples (T, D), `step_s` apart.
        step_s: time between samples, s.
        order: 1 or 2.
        window_s: length of the fit, s; shorter than that when there are fewer samples.

    Returns:
        The derivative (T, D), in units of `values` per s**order; (0, D) when T is below
        five, the fewest samples that a cubic smooths.

    Source: Savitzky and Golay, Analytical Chemistry 36(8), 1964.
    """
    count = values.shape[0]
    half = min(max(round(0.5 * window_s / step_s), 2), (count - 1) // 2)
    if half < 2:
        return np.zeros((0, values.shape[1]))
    offsets = np.arange(-half, half + 1)
    fit = np.linalg.pinv(np.vander(offsets, DEGREE + 1, increasing=True))  # (4, window) samples -> cubic
    weights = _differentiated(fit, offsets, order) / step_s**order  # (window, window)
    windows = np.lib.stride_tricks.sliding_window_view(
        values, 2 * half + 1, axis=0
    )  # (T - 2 half, D, window)
    inner = windows @ weights[half]
    first = weights[:half] @ values[: 2 * half + 1]
    last = weights[half + 1 :] @ values[-(2 * half + 1) :]
    return np.concatenate([first, inner, last])


def _differentiated(fit: Float, at: Float, order: int) -> Float:
    """Weights (N, window) that give the fitted cubic's derivative at each offset of `at` (N,)."""
    if order == 1:
        powers = np.stack([0.0 * at, 0.0 * at + 1.0, 2.0 * at, 3.0 * at**2], axis=1)
    else:
        powers = np.stack([0.0 * at, 0.0 * at, 0.0 * at + 2.0, 6.0 * at], axis=1)
    return np.asarray(powers @ fit)


def squared_integral(values: Float, step_s: float) -> float:
    """∫ ‖x‖² dt of samples (T, D) by the trapezoid rule; NaN when empty."""
    if values.shape[0] == 0:
        return float("nan")
    return float(np.trapezoid(np.sum(values**2, axis=1), dx=step_s))


def _integral(log: TrialLog, order: int) -> float:
    """∫‖x‖² dt of the first or second derivative of the flown velocity."""
    return squared_integral(derivative(log.steps.velocity_mps, log.step_s, order), log.step_s)


METRICS: Metrics = {
    Metric(
        column="acceleration_integral_m2ps3",
        title="Smoothness, ∫‖acceleration‖²",
        unit="m²/s³",
        digits=1,
        better=-1,
        needs_arrival=True,
        missing="the flight had fewer than five rows",
    ): lambda flight: _integral(flight.log, 1),
    Metric(
        column="jerk_integral_m2ps5",
        title="Smoothness, ∫‖jerk‖²",
        unit="m²/s⁵",
        digits=0,
        better=-1,
        needs_arrival=True,
        missing="the flight had fewer than five rows",
    ): lambda flight: _integral(flight.log, 2),
    Metric(
        column="reference_acceleration_integral_m2ps3",
        title="∫‖acceleration of the reference‖²",
        unit="m²/s³",
        digits=1,
        better=-1,
        needs_arrival=True,
        missing="the flight never began",
    ): lambda flight: squared_integral(flight.log.steps.reference_acceleration_mps2, flight.log.step_s),
}

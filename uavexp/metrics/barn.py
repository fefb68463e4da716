"""How flights through the worlds of BARN score: clock and metric of the BARN Challenge.

The clock runs from when the vehicle is 0.1 m from its start until it is within 1 m of the target, in the
plane. The metric is 1 {success} OT / clip(AT, low OT, 8 OT), with the actual time AT and the optimal time
OT, the reference path at 2 m/s; low is 4 in the first challenges (Xiao et al. 2022), 2 in later ones, so
that 0.25 and 0.5 are the most there is. Success is ours: arrived, held, and without contact; within 100 s.
"""

from __future__ import annotations

import math

import numpy as np

from uavexp.metrics.ending import success
from uavexp.metrics.metric import Flight, Metric, Metrics
from uavexp.world.barn_layouts import layout, number_of

TOP_SPEED_MPS = 2.0  # of the challenge's robot
LEFT_M = 0.1
ARRIVED_M = 1.0
MOST_S = 100.0
SLOWEST = 8.0  # times the optimal time, beyond which slowness costs nothing more


def optimal_time_s(flight: Flight) -> float | None:
    """Published reference path at the robot's top speed; None in any other world."""
    number = number_of(flight.world.name)
    return None if number is None else layout(number).reference_path_m / TOP_SPEED_MPS


def actual_time_s(flight: Flight) -> float | None:
    """Time by the challenge's clock; NaN when the vehicle never left or never came near."""
    if number_of(flight.world.name) is None:
        return None
    steps, world = flight.log.steps, flight.world
    left = np.linalg.norm(steps.position_m[:, :2] - world.start_m[:2], axis=1) >= LEFT_M
    near = np.linalg.norm(steps.position_m[:, :2] - world.target_m[:2], axis=1) <= ARRIVED_M
    if not (left.any() and near.any()):
        return math.nan
    return float(steps.time_s[near.argmax()] - steps.time_s[left.argmax()])


def score(flight: Flight, fastest: float) -> float | None:
    """The challenge's metric; `fastest`, times the optimal time, is what haste beyond gains nothing."""
    optimal_s, actual_s = optimal_time_s(flight), actual_time_s(flight)
    if optimal_s is None or actual_s is None:
        return None
    if not success(flight.log) or not actual_s <= MOST_S:
        return 0.0
    return optimal_s / min(max(actual_s, fastest * optimal_s), SLOWEST * optimal_s)


def collided(flight: Flight) -> bool | None:
    """Whether anything was touched, as the challenge counts."""
    return None if number_of(flight.world.name) is None else bool(flight.log.contacts)


METRICS: Metrics = {
    Metric(
        column="barn_collided", title="With contact", unit="%", digits=1, better=-1, scale=100.0
    ): collided,
    Metric(
        column="barn_time_s",
        title="Time by BARN's clock",
        unit="s",
        digits=1,
        better=-1,
        needs_arrival=True,
        missing="the target was not come near to",
    ): actual_time_s,
    Metric(column="barn_optimal_time_s", title="BARN's optimal time", unit="s", digits=1): optimal_time_s,
    Metric(column="barn_score", title="BARN's metric, clipped at 2 and 8", digits=3, better=1): (
        lambda flight: score(flight, 2.0)
    ),
    Metric(column="barn_score_4", title="BARN's metric, clipped at 4 and 8", digits=3, better=1): (
        lambda flight: score(flight, 4.0)
    ),
}

"""All the numbers of one flight, from its log alone."""

from __future__ import annotations

from uavexp.log import TrialLog
from uavexp.metrics import clearance, coverage, path, plan, replanning, smoothness, tracking, tracking_movers
from uavexp.types import Outcome, World

Metrics = dict[str, bool | int | float | str]

ARRIVED = (Outcome.REACHED, Outcome.EXPLORED, Outcome.INSPECTED)


def evaluate(
    log: TrialLog,
    world: World,
    *,
    safety_threshold_m: float = 0.30,
    useful_change_m: float = 0.10,
    near_miss_m: float = 0.50,
) -> Metrics:
    """Return every metric of a flight; recomputable from a stored log without flying.

    Args:
        log: what the flight left behind; may be empty (an error before the first step).
        world: the truth it was flown in.
        safety_threshold_m: clearance under which time counts as unsafe, m ([ours]: MCR's mean
            smallest clearance in Chen et al. 2026 is 0.31 m).
        useful_change_m: departure from the old plan from which a replan was useful, m [ours].

        near_miss_m: distance of the body's centre from a mover below which it is a near miss, m
            ([ours]: the buffer delta of paper 2).

    Returns:
        One plain value per name, units in the names. NaN says that a figure does not exist
        (no rows, no replans, no target), never that it is zero.
    """
    return {
        "outcome": str(log.outcome),
        "success": log.outcome in ARRIVED and not log.contacts,
        **_path(log, world),
        **_clearance(log, safety_threshold_m),
        **_replanning(log, useful_change_m),
        **_tracking(log),
        **_smoothness(log),
        **plan.measures(log, world),
        **plan.costs(log),
        "seen_share": float(log.seen_share),
        **tracking_movers.measures(log, near_miss_m),
        **coverage.measures(log, world),
    }


def _path(log: TrialLog, world: World) -> Metrics:
    length_m = path.path_length_m(log)
    shortest_m = float(world.difficulty.shortest_path_m)
    time_s = path.completion_time_s(log)
    speed_mps = path.speed_mps(log)
    return {
        "path_length_m": length_m,
        "shortest_path_m": shortest_m,
        "detour": path.detour(length_m, shortest_m),
        "completion_time_s": time_s,
        "mean_speed_mps": length_m / time_s if time_s > 0.0 else 0.0,
        "max_speed_mps": float(speed_mps.max(initial=0.0)),
    }


def _clearance(log: TrialLog, safety_threshold_m: float) -> Metrics:
    return {
        "collision_count": len(log.contacts),
        "contact_time_s": clearance.contact_time_s(log),
        "min_clearance_m": clearance.smallest_m(log.steps.clearance_m),
        "min_clearance_esdf_m": clearance.smallest_m(log.ticks.esdf_clearance_m),
        "safety_threshold_m": safety_threshold_m,
        "time_below_safety_s": clearance.time_below_s(log, safety_threshold_m),
    }


def _replanning(log: TrialLog, useful_change_m: float) -> Metrics:
    replans = replanning.executed(log)
    counts = replanning.count_by_cause(replans)
    return {
        "replans": len(replans),
        **{f"replans_{cause}": count for cause, count in counts.items()},
        "useful_replans": replanning.count_useful(replans, useful_change_m),
        "failed_plans": len(replanning.failed(log)),
        "dropped_triggers": log.dropped_triggers,
        "replans_per_m": replanning.rate(len(replans), path.path_length_m(log)),
        "replans_per_s": replanning.rate(len(replans), path.completion_time_s(log)),
        "replans_near_change_share": replanning.share_near_change(replans),
        **replanning.blocked_delays(log),
    }


def _tracking(log: TrialLog) -> Metrics:
    tracking_m = tracking.distances_m(log.steps.position_m, log.steps.reference_position_m)
    estimate_m = tracking.distances_m(log.steps.position_m, log.steps.estimated_position_m)
    return {
        "tracking_error_m": tracking.rmse_m(tracking_m),
        "tracking_error_max_m": float(tracking_m.max()) if tracking_m.size else float("nan"),
        "estimate_error_m": tracking.rmse_m(estimate_m),
    }


def _smoothness(log: TrialLog) -> Metrics:
    acceleration_mps2 = smoothness.derivative(log.steps.velocity_mps, log.step_s, order=1)
    jerk_mps3 = smoothness.derivative(log.steps.velocity_mps, log.step_s, order=2)
    return {
        "acceleration_integral_m2ps3": smoothness.squared_integral(acceleration_mps2, log.step_s),
        "jerk_integral_m2ps5": smoothness.squared_integral(jerk_mps3, log.step_s),
        "reference_acceleration_integral_m2ps3": smoothness.squared_integral(
            log.steps.reference_acceleration_mps2, log.step_s
        ),
    }

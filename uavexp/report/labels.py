"""The metrics as the report shows them: names, units, decimals, and which way is better."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from uavexp.errors import ConfigError
from uavexp.metrics.tracking_movers import HORIZONS_S, MEAN_HORIZONS_S, WITHIN_M
from uavexp.parameters import nearest

SUCCESS = "success"
ALL_CAUSES = "causes"  # stands for a metric per cause of replanning


@dataclass(frozen=True, slots=True, kw_only=True)
class Metric:
    """A column of the trials as the report shows it."""

    column: str
    label: str  # with unit
    digits: int  # shown
    better: int = 0  # 1: more is better, -1: less, 0: neither
    scale: float = 1.0  # shown value over stored value
    is_count: bool = False  # of events in a flight: bounded also where none occurred
    # a path cut short by failure is not a shorter path: compared where both arms succeeded, too
    needs_arrival: bool = False

    @property
    def is_rate(self) -> bool:
        """Whether it is a share of trials, not a mean."""
        return self.column == SUCCESS


RATE = Metric(column=SUCCESS, label="Success rate, SR [%]", digits=1, better=1, scale=100.0)
PATH = Metric(column="path_length_m", label="Path length, APL [m]", digits=1, better=-1, needs_arrival=True)
TIME = Metric(
    column="completion_time_s", label="Completion time, CT [s]", digits=1, better=-1, needs_arrival=True
)
CONTACTS = Metric(column="collision_count", label="Collisions, CC", digits=2, better=-1, is_count=True)
CLEARANCE = Metric(column="min_clearance_m", label="Min. clearance, MC [m]", digits=3, better=1)
REPLANS = Metric(column="replans", label="Replans, RF", digits=1, better=-1, is_count=True)
TRACKING = Metric(
    column="tracking_error_m",
    label="Tracking error, TE [m RMSE]",
    digits=3,
    better=-1,
    needs_arrival=True,  # after a collision it is the distance from a reference that flies on alone
)

DETOUR = Metric(column="detour", label="Path / shortest path", digits=2, better=-1, needs_arrival=True)
UNSAFE = Metric(column="time_below_safety_s", label="Time below safe clearance [s]", digits=2, better=-1)
ACCELERATION = Metric(
    column="acceleration_integral_m2ps3",
    label="Smoothness, ∫‖acceleration‖² [m²/s³]",
    digits=1,
    better=-1,
    needs_arrival=True,
)
JERK = Metric(
    column="jerk_integral_m2ps5",
    label="Smoothness, ∫‖jerk‖² [m²/s⁵]",
    digits=0,
    better=-1,
    needs_arrival=True,
)
NEAR_CHANGE = Metric(
    column="replans_near_change_share",
    label="Replans near a map change [%]",
    digits=0,
    better=1,
    scale=100.0,
)
USEFUL = Metric(column="useful_share", label="Useful replans [%]", digits=0, better=1, scale=100.0)
USEFUL_REPLANS = Metric(column="useful_replans", label="Useful replans", digits=1, better=1, is_count=True)
WASTED = Metric(column="wasted_replans", label="Wasted replans", digits=1, better=-1, is_count=True)
BLOCKED_DELAY = Metric(
    column="blocked_delay_s", label="Delay from blocked path to request [s]", digits=3, better=-1
)
BLOCKED_UNANSWERED = Metric(
    column="blocked_unanswered",
    label="Blocked paths without an answer",
    digits=2,
    better=-1,
    is_count=True,
)

TABLE_1 = (RATE, PATH, TIME, CONTACTS, CLEARANCE, REPLANS, TRACKING)

# causes of replans, by column: one table row each where any trial has some
CAUSE_COLUMNS = {
    f"replans_{cause}": f"Replans, cause {cause}"
    for cause in (
        "map",
        "goal",
        "clock",
        "distance",
        "collision",
        "covered",
        "expired",
        "arrival",
        "risk",
        "other",
    )
}

CAUSE_METRICS = tuple(
    Metric(column=column, label=label, digits=1, is_count=True) for column, label in CAUSE_COLUMNS.items()
)

FURTHER = (
    DETOUR,
    Metric(column="mean_speed_mps", label="Mean speed [m/s]", digits=2),
    Metric(column="min_clearance_esdf_m", label="Min. clearance in the map (ESDF) [m]", digits=3, better=1),
    UNSAFE,
    Metric(column="contact_time_s", label="Time in contact [s]", digits=2, better=-1),
    ACCELERATION,
    JERK,
    *CAUSE_METRICS,
    Metric(column="replans_per_m", label="Replans per metre [1/m]", digits=2),
    Metric(column="replans_per_s", label="Replans per second [1/s]", digits=2),
    NEAR_CHANGE,
    USEFUL,
    Metric(column="failed_plans", label="Requests without a plan", digits=2, better=-1, is_count=True),
    Metric(column="dropped_triggers", label="Triggers dropped while planning", digits=2, is_count=True),
    Metric(column="blocked_episodes", label="Times the path was blocked", digits=2, is_count=True),
    BLOCKED_DELAY,
    BLOCKED_UNANSWERED,
    Metric(column="tracking_error_max_m", label="Largest tracking error [m]", digits=2, better=-1),
)

# the first plan of a flight, as planned
PLANS = (
    Metric(column="limit_violations", label="Limit violations of the plan", digits=2, better=-1),
    Metric(column="plan_max_speed_mps", label="Max. planned speed [m/s]", digits=2),
    Metric(column="plan_max_acceleration_mps2", label="Max. planned acceleration [m/s²]", digits=2),
    Metric(column="plan_collisions", label="Collisions of the plan", digits=2, better=-1),
    Metric(column="plan_min_clearance_m", label="Least true clearance of the plan [m]", digits=2, better=1),
    Metric(column="plan_length_m", label="Length of the plan [m]", digits=2, better=-1),
    Metric(column="plan_path_length_m", label="Length of the searched path [m]", digits=2, better=-1),
    Metric(column="plan_path_height_reversals", label="Reversals of height", digits=2, better=-1),
    Metric(
        column="plan_path_excess_climb_m", label="Height gained and lost for nothing [m]", digits=2, better=-1
    ),
    Metric(column="plan_path_heading_change_deg", label="Heading change, summed [°]", digits=0, better=-1),
    Metric(
        column="plan_path_mean_heading_change_deg",
        label="Heading change, mean of turns [°]",
        digits=1,
        better=-1,
    ),
    Metric(column="plan_duration_s", label="Duration of the plan [s]", digits=2, better=-1),
    Metric(column="plan_iterations", label="Iterations", digits=0),
    Metric(column="plan_collision_checks", label="Collision checks", digits=0, better=-1),
    Metric(column="wall_search_sum_s", label="Search time [ms]", digits=1, better=-1, scale=1e3),
    Metric(column="wall_optimise_sum_s", label="Smoothing time [ms]", digits=1, better=-1, scale=1e3),
)

# of flights among movers
MOVERS = (
    Metric(column="mover_contacts", label="Contacts with movers", digits=2, better=-1, is_count=True),
    Metric(column="near_misses", label="Near misses of movers", digits=2, better=-1, is_count=True),
    Metric(column="min_mover_clearance_m", label="Min. distance to a mover [m]", digits=2, better=1),
    Metric(column="track_error_m", label="Position error of tracks [m]", digits=3, better=-1),
    *(
        Metric(
            column=f"prediction_error_{ahead_s:g}s_m",
            label=f"Prediction error after {ahead_s:g} s [m]",
            digits=3,
            better=-1,
        )
        for ahead_s in HORIZONS_S
    ),
    Metric(
        column="prediction_error_mean_m",
        label=f"Prediction error, mean over {MEAN_HORIZONS_S[-1]:g} s [m]",
        digits=3,
        better=-1,
    ),
    Metric(
        column="missed_track_share",
        label=f"Movers within {WITHIN_M:g} m not tracked [%]",
        digits=1,
        better=-1,
        scale=100.0,
    ),
    Metric(column="false_track_share", label="False tracks [%]", digits=1, better=-1, scale=100.0),
    Metric(column="identity_switches", label="Identity switches", digits=2, better=-1, is_count=True),
)

# of inspections
INSPECTION = (
    Metric(column="coverage_visible", label="Coverage of the visible [%]", digits=2, better=1, scale=100.0),
    Metric(
        column="coverage_truth", label="Coverage of the true surface [%]", digits=2, better=1, scale=100.0
    ),
    Metric(column="coverage", label="Coverage of all targets [%]", digits=2, better=1, scale=100.0),
    Metric(column="viewpoints", label="Viewpoints", digits=1, is_count=True),
    Metric(column="unreachable", label="Viewpoints not reached", digits=2, better=-1, is_count=True),
    Metric(column="tour_length_m", label="Tour as planned, straight [m]", digits=1, better=-1),
    Metric(column="segment_switches", label="Segment switches", digits=1, better=-1, is_count=True),
    Metric(
        column="wall_explore_median_s", label="Choice of view, median [ms]", digits=1, better=-1, scale=1e3
    ),
    Metric(column="wall_explore_p99_s", label="Choice of view, 99 % [ms]", digits=1, better=-1, scale=1e3),
    Metric(
        column="wall_optimise_median_s", label="Optimisation, median [ms]", digits=1, better=-1, scale=1e3
    ),
    Metric(column="wall_optimise_p99_s", label="Optimisation, 99 % [ms]", digits=1, better=-1, scale=1e3),
)

FALSE_TRIGGERS = Metric(column="false_triggers_per_min", label="False triggers [1/min]", digits=2, better=-1)

_BY_COLUMN = {
    metric.column: metric
    for metric in (*TABLE_1, *FURTHER, *MOVERS, *PLANS, *INSPECTION, WASTED, FALSE_TRIGGERS)
}


def metrics_of(names: Iterable[str]) -> tuple[Metric, ...]:
    """The metrics of these names in their order; `causes` stands for a metric per cause.

    Raises:
        ConfigError: one is unknown.
    """
    found: list[Metric] = []
    for name in names:
        if name != ALL_CAUSES and name not in _BY_COLUMN:
            known = ", ".join(sorted((*_BY_COLUMN, ALL_CAUSES)))
            raise ConfigError(f"no such metric: {name}{nearest(name, _BY_COLUMN)}; there are {known}")
        found += CAUSE_METRICS if name == ALL_CAUSES else (_BY_COLUMN[name],)
    return tuple(found)

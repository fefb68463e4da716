"""What a metric is: a number of a flight with its column, unit and better direction."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from uavexp.log import TrialLog
from uavexp.types import World

Value = bool | int | float | str
Values = dict[str, Value]
SUCCESS = "success"


@dataclass(frozen=True, kw_only=True, eq=False)
class Flight:
    """What metrics are measured on: a log, which may be empty, the true world, and four limits."""

    log: TrialLog
    world: World
    # m, clearance under which time counts as unsafe ([ours]: MCR's mean smallest clearance in
    # Chen et al. 2026 is 0.31 m)
    safety_threshold_m: float = 0.30
    useful_change_m: float = 0.10  # m, departure from the old plan from which a replan was useful [ours]
    arrival_m: float = 0.30  # m, the vehicle believes to be there within this distance (`Goto.tolerance_m`)
    near_miss_m: float = 0.50  # m, of a mover from the body's centre ([ours]: the buffer delta of paper 2)


@dataclass(frozen=True, slots=True, kw_only=True)
class Metric:
    """A column of the trials: what it is called, how it is shown, and which way is better."""

    column: str
    title: str = ""  # without the unit; none: the column's name
    unit: str = ""  # as shown
    digits: int = 2  # shown
    better: int = 0  # 1: more is better, -1: less, 0: neither
    scale: float = 1.0  # shown value over stored value
    is_count: bool = False  # of events in a flight: bounded also where none occurred
    # a path cut short by failure is not a shorter path: compared where both arms succeeded, too
    needs_arrival: bool = False
    missing: str = ""  # when it is NaN, which never says that it is zero; none: never

    @property
    def label(self) -> str:
        """Title and unit."""
        title = self.title or self.column
        return f"{title} [{self.unit}]" if self.unit else title

    @property
    def is_rate(self) -> bool:
        """Whether it is a share of trials, not a mean."""
        return self.column == SUCCESS


Measure = Callable[[Flight], Value | None]  # None: a flight of this kind has no such column
Metrics = Mapping[Metric, Measure]  # what a file of metrics declares, each where it is computed


def measured(metrics: Metrics, flight: Flight) -> Values:
    """Values by column; without those that a flight of this kind does not have."""
    values = {metric.column: measure(flight) for metric, measure in metrics.items()}
    return {column: value for column, value in values.items() if value is not None}

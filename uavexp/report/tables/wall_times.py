"""Clock times of planning by arm: the one table that differs from run to run."""

from __future__ import annotations

from uavexp.report import number_format
from uavexp.report.results import Results
from uavexp.report.tables.base import Table

_LABELS = {
    "wall_optimise_median_s": "optimisation, median",
    "wall_optimise_p99_s": "optimisation, 99th percentile",
    "wall_search_median_s": "path search, median",
    "wall_trigger_median_s": "trigger, median",
}


def table(results: Results, *, name: str) -> Table | None:
    """Medians over flights; none where no time was kept."""
    trials = results.study.measurements
    have = [column for column in _LABELS if column in trials]
    if not have:
        return None
    by_arm = trials.groupby(list(results.arm_axes), sort=False, observed=True)[have].median()
    rows = tuple(
        (
            ", ".join(key) if isinstance(key, tuple) else str(key),
            *(number_format.number(1e3 * value, 2) for value in values),
        )
        for key, values in zip(by_arm.index, by_arm.to_numpy(dtype=float), strict=True)
    )
    return Table(
        name=name,
        title="Clock times of one call [ms]",
        columns=("", *(_LABELS[column] for column in have)),
        rows=rows,
        notes=("Median over flights, on the machine named in run.json: differs from run to run.",),
    )

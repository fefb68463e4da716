"""Replanning policies against each other: safety, cost, and whether their replans were worth it."""

from __future__ import annotations

import numpy as np

from uavexp.report import shown
from uavexp.report.findings import Findings, arms_table, circumstances, study_panel, values_table
from uavexp.report.paired import comparisons_table, paired_tests
from uavexp.store.study import Study

FLIGHT = (
    shown.RATE,
    shown.CONTACTS,
    shown.CLEARANCE,
    shown.UNSAFE,
    shown.DETOUR,
    shown.TIME,
    shown.TRACKING,
)
REPLANNING = (
    shown.REPLANS,
    shown.USEFUL,
    shown.WASTED,
    shown.NEAR_CHANGE,
    shown.BLOCKED_DELAY,
    shown.BLOCKED_UNANSWERED,
    *shown.CAUSE_METRICS,
)
_COMPARED = (
    shown.RATE,
    shown.CONTACTS,
    shown.CLEARANCE,
    shown.DETOUR,
    shown.TIME,
    shown.REPLANS,
    shown.WASTED,
    shown.BLOCKED_DELAY,
)
_USEFUL = (
    "A replan was useful when the new path departs from the old one by more than 0.1 m, else wasted. "
    "Delay: from the first map update on which the path flown was blocked to the next request; mean of the "
    "answered ones; of each replan: column delay_s of replans.parquet."
)


def findings(study: Study) -> Findings:
    """How the policies flew, how they replanned, and each against the primary one."""
    panel = study_panel(study, (*FLIGHT, *REPLANNING))
    notes = circumstances(study, panel)
    primary = str(study.settings.get("primary", "MCR"))
    others = [(primary, arm) for arm in panel.arms if arm != primary] if primary in panel.arms else []
    occurring = [
        metric
        for metric in REPLANNING
        if metric.column not in shown.CAUSES
        or (panel.has(metric) and np.nansum(panel.columns[metric.column]) > 0.0)
    ]
    title = study.title or "Replanning policies"
    return Findings(
        tables=(
            arms_table(panel, FLIGHT, name="policies", title=title, notes=notes),
            arms_table(
                panel,
                occurring,
                name="replanning",
                title="How often, why, and was it worth it",
                notes=(*notes, _USEFUL),
            ),
            comparisons_table(paired_tests(panel, _COMPARED, others)),
        ),
        values=(values_table(panel, (*FLIGHT, *REPLANNING)),),
    )

"""A study without a report of its own: a row per arm."""

from __future__ import annotations

from uavexp.report import shown
from uavexp.report.findings import Findings, arms_table, circumstances, study_panel, values_table
from uavexp.store.study import Study

METRICS = (*shown.TABLE_1, shown.DETOUR, shown.UNSAFE)


def findings(study: Study) -> Findings:
    """One table: how each arm did."""
    panel = study_panel(study, METRICS)
    table = arms_table(
        panel,
        METRICS,
        name="summary",
        title=study.title or "How each configuration did",
        notes=circumstances(study, panel),
    )
    return Findings(tables=(table,), values=(values_table(panel, METRICS),))

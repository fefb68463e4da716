"""A row per scene, a column per arm: the means of a few metrics in it."""

from __future__ import annotations

import math

import numpy as np

from uavexp.metrics.metric import Metric
from uavexp.report import number_format
from uavexp.report.labels import CONTACTS, RATE, REPLANS
from uavexp.report.results import Results
from uavexp.report.tables.base import Table

METRICS = (RATE, CONTACTS, REPLANS)


def table(results: Results, *, name: str, metric: Metric | None = None) -> Table | None:
    """One metric, or success, collisions and replans, of each arm in each scene; none without scenes."""
    asked = METRICS if metric is None else (metric,)
    panel, shown = results.panel, [item for item in asked if results.panel.has(item)]

    def cell(scene: str, arm: str) -> str:
        rows = panel.scene == panel.scenes.index(scene)
        values = [panel.values(item, arm)[rows] for item in shown]
        means = [float(np.nanmean(some)) if np.isfinite(some).any() else math.nan for some in values]
        return " / ".join(
            number_format.number(mean, item.digits if metric else 0 if item.is_rate else 1)
            for mean, item in zip(means, shown, strict=True)
        )

    rows = tuple(
        (
            scene,
            str(int((panel.scene == panel.scenes.index(scene)).sum())),
            *(cell(scene, arm) for arm in panel.arms),
        )
        for scene in results.scenes
    )
    if not rows:
        return None
    return Table(
        name=name,
        title=f"{metric.label} by scene" if metric else "Success rate [%] / collisions / replans by scene",
        columns=("scene", "worlds", *panel.arms),
        rows=rows,
        notes=("Means over the worlds of a scene.",),
    )

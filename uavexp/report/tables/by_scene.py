"""A row per scene, a column per arm: the means of a few metrics in it."""

from __future__ import annotations

import math

import numpy as np

from uavexp.report import number_format
from uavexp.report.labels import CONTACTS, RATE, REPLANS
from uavexp.report.results import Results
from uavexp.report.tables.base import Table

METRICS = (RATE, CONTACTS, REPLANS)


def table(results: Results, *, name: str) -> Table | None:
    """Success, collisions and replans of each arm in each scene; none without scenes."""
    panel, shown = results.panel, [metric for metric in METRICS if results.panel.has(metric)]

    def cell(scene: str, arm: str) -> str:
        rows = panel.scene == panel.scenes.index(scene)
        values = [panel.values(metric, arm)[rows] for metric in shown]
        means = [float(np.nanmean(some)) if np.isfinite(some).any() else math.nan for some in values]
        return " / ".join(
            number_format.number(mean, 0 if metric.is_rate else 1)
            for mean, metric in zip(means, shown, strict=True)
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
        title="Success rate [%] / collisions / replans by scene",
        columns=("scene", "worlds", *panel.arms),
        rows=rows,
        notes=("Means over the worlds of a scene.",),
    )

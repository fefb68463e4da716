"""Table 1 of Chen et al. 2026 flown again, with the paper's value in each cell."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import product

import numpy as np
import pandas as pd

from uavexp.report import cells, shown
from uavexp.report.claims import claims_of
from uavexp.report.comparison import SCENE, Metric, Panel, estimate
from uavexp.report.contradictions import contradictions
from uavexp.report.findings import (
    FAILED,
    INTERVALS,
    Findings,
    arm_axes,
    circumstances,
    study_panel,
    values_table,
)
from uavexp.report.paired import RULE, comparisons_table, paired_tests
from uavexp.report.parts import Table
from uavexp.report.reference import Reference, read_reference
from uavexp.store.study import Study

_SPREAD = (
    "Mean ± standard deviation over flights; of the success rate over the scenes' rates. Flights that "
    "failed count with what they flew until then."
)
_WALL = {
    "wall_optimise_median_s": "optimisation, median",
    "wall_optimise_p99_s": "optimisation, 99th percentile",
    "wall_search_median_s": "path search, median",
    "wall_trigger_median_s": "trigger, median",
}


def findings(study: Study) -> Findings:
    """Tables and verdicts of a study of replanning strategies."""
    panel = study_panel(study, (*shown.TABLE_1, *shown.FURTHER))
    reference = read_reference(study.name)
    tests = paired_tests(panel, shown.COMPARED, comparisons(study, panel))
    notes = circumstances(study, panel)
    return Findings(
        tables=(
            _strategies(panel, shown.TABLE_1, reference, "table1", study.title, notes),
            comparisons_table(tests, RULE),
            _strategies(panel, _occurring(panel), {}, "further", "Further metrics", notes),
            *_scenes(study, panel),
            *_clock(study),
            contradictions(reference),
        ),
        claims=claims_of(panel, tests, reference, primary(study), time_based(study)),
        rule=RULE,
        values=(values_table(panel, (*shown.TABLE_1, *shown.FURTHER)),),
    )


def primary(study: Study) -> str:
    """Arm that the others are compared with (`settings.primary`)."""
    return str(study.settings.get("primary", "MCR"))


def time_based(study: Study) -> str:
    """Arm that replans by the clock as the paper does (`settings.time_based`)."""
    return str(study.settings.get("time_based", "TBR"))


def comparisons(study: Study, panel: Panel) -> tuple[tuple[str, str], ...]:
    """The primary arm against each of the others, then the clock against planning once."""
    first, clock, once = primary(study), time_based(study), "SSP"
    pairs = [(first, other) for other in panel.arms if other != first] if first in panel.arms else []
    if first != clock and {clock, once} <= set(panel.arms):
        pairs.append((clock, once))
    return tuple(pairs)


def _occurring(panel: Panel) -> tuple[Metric, ...]:
    """Further metrics without the causes of replanning that never occurred."""
    return tuple(
        metric
        for metric in shown.FURTHER
        if panel.has(metric)
        and not (metric.column in shown.CAUSES and np.nansum(panel.columns[metric.column]) == 0.0)
    )


def _strategies(
    panel: Panel,
    metrics: Sequence[Metric],
    reference: Reference,
    name: str,
    title: str,
    notes: Sequence[str],
) -> Table:
    """A row per metric, a column per arm: mean ± SD [interval], the paper's beside."""

    def cell(metric: Metric, arm: str) -> str:
        found = cells.mean_with_spread(estimate(panel, metric, arm), metric, panel.n(arm))
        printed = reference.get((metric.column, arm))
        if printed is None:
            return found
        spread = f" ± {printed.sd:g}" if math.isfinite(printed.sd) else ""
        return f"{found} (paper: {printed.mean:g}{spread})"

    flown = ("Trials, n", *(str(panel.n(arm)) for arm in panel.arms))
    rows = [
        (metric.label, *(cell(metric, arm) for arm in panel.arms)) for metric in metrics if panel.has(metric)
    ]
    printed_notes = [
        f"Paper, {arm}, {metric.label}: {found.notes}."
        for metric, arm in product(metrics, panel.arms)
        if (found := reference.get((metric.column, arm))) and len(found.notes) > 1
    ]
    return Table(
        name=name,
        title=title,
        columns=("", *panel.arms),
        rows=(flown, *rows),
        notes=(*notes, _SPREAD, INTERVALS, FAILED, *printed_notes),
    )


def _scenes(study: Study, panel: Panel) -> tuple[Table, ...]:
    """How each arm did in each scene, and how hard the scenes are; none without scenes."""
    if SCENE not in study.axes:
        return ()
    order = [scene for scene in study.axes[SCENE] if scene in panel.scenes]
    return (_per_scene(panel, order), _difficulty(study.trials, order))


def _per_scene(panel: Panel, order: Sequence[str]) -> Table:
    metrics = [metric for metric in (shown.RATE, shown.CONTACTS, shown.REPLANS) if panel.has(metric)]

    def cell(scene: str, arm: str) -> str:
        rows = panel.scene == panel.scenes.index(scene)
        values = [panel.values(metric, arm)[rows] for metric in metrics]
        means = [float(np.nanmean(some)) if np.isfinite(some).any() else math.nan for some in values]
        return " / ".join(
            cells.number(mean, 0 if metric.is_rate else 1)
            for mean, metric in zip(means, metrics, strict=True)
        )

    return Table(
        name="scenes",
        title="Success rate [%] / collisions / replans by scene",
        columns=("scene", "worlds", *panel.arms),
        rows=tuple(
            (
                scene,
                str(int((panel.scene == panel.scenes.index(scene)).sum())),
                *(cell(scene, arm) for arm in panel.arms),
            )
            for scene in order
        ),
        notes=("Means over the worlds of a scene.",),
    )


def _difficulty(trials: pd.DataFrame, order: Sequence[str]) -> Table:
    labels = {
        "shortest_path_m": "shortest path [m]",
        "straight_line_m": "straight line [m]",
        "clutter_density": "occupied share of the flight band",
        "narrowest_gap_m": "narrowest gap on the shortest path [m]",
    }
    have = [name for name in labels if name in trials]
    worlds = trials.dropna(subset=have).drop_duplicates([SCENE, "seed"])

    def cell(scene: str, name: str) -> str:
        values = worlds.loc[worlds[SCENE].astype(str) == scene, name].to_numpy(dtype=float)
        if not values.size:
            return cells.NONE
        return f"{values.mean():.2f} [{values.min():.2f}, {values.max():.2f}]"

    return Table(
        name="difficulty",
        title="How hard the worlds are, measured on their true geometry",
        columns=("scene", *(labels[name] for name in have)),
        rows=tuple((scene, *(cell(scene, name) for name in have)) for scene in order),
        notes=("Mean [least, greatest] over the worlds of a scene.",),
    )


def _clock(study: Study) -> tuple[Table, ...]:
    """Clock times of planning by arm: the one table that differs from run to run."""
    have = [name for name in _WALL if name in study.trials]
    if not have:
        return ()
    by_arm = study.trials.groupby(list(arm_axes(study)), sort=False, observed=True)[have].median()
    rows = [
        (
            ", ".join(key) if isinstance(key, tuple) else str(key),
            *(cells.number(1e3 * value, 2) for value in values),
        )
        for key, values in zip(by_arm.index, by_arm.to_numpy(dtype=float), strict=True)
    ]
    return (
        Table(
            name="wall_times",
            title="Clock times of one call [ms]",
            columns=("", *(_WALL[name] for name in have)),
            rows=tuple(rows),
            notes=("Median over flights, on the machine named in run.json: differs from run to run.",),
        ),
    )

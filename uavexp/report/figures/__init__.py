"""The figures of a report: drawn from what the study has; those that need more are left out, and why."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import cache, partial

import pandas as pd

from uavexp.errors import RecordError, one_line
from uavexp.report import shown, style
from uavexp.report.arms import metrics_of
from uavexp.report.comparison import SCENE, Panel
from uavexp.report.figures import (
    attribution,
    convergence,
    flown,
    inspected,
    over_time,
    paths,
    plans,
    policies,
    replans,
    robustness,
    safety,
    success,
    tradeoff,
)
from uavexp.report.figures.arms import metric_panels
from uavexp.report.figures.looks import clock_arm, looks_of, primary_arm
from uavexp.report.findings import circumstances, study_panel
from uavexp.report.parts import Drawing
from uavexp.report.reference import read_reference
from uavexp.store.study import Study

_PLANE = (shown.RATE, shown.CLEARANCE, shown.REPLANS)
_SAFETY_M = 0.30  # m; where a study does not say (`metrics.summary`)


# name and how it is drawn; None: there is nothing to show. RecordError: what it shows cannot be read
Figures = Iterator[tuple[str, Callable[[], Drawing | None]]]


def drawings_of(study: Study, left_out: Callable[[str], None] = lambda line: None) -> Iterator[Drawing]:
    """Draw the figures of a study, one after the other.

    Args:
        study: read; `study.report` says which figures are drawn.
        left_out: told which figure is left out and why: its flights or their world are not in
            the folder, or damaged.
    """
    for name, draw in _KINDS.get(study.report, _summary)(study):
        try:
            with style.house_style():  # not around `yield`: it would hold for whoever draws in between
                drawing = draw()
        except RecordError as error:
            left_out(missing(name, error, study))
            continue
        if drawing is not None:
            yield drawing


def missing(name: str, error: RecordError, study: Study) -> str:
    """The sentence that says why something is not shown, with no path outside the study."""
    return f"{name} is left out: {one_line(error).replace(f'{study.folder}/', '')}"


def _summary(study: Study) -> Figures:
    panel = study_panel(study, (shown.RATE,))
    looks, note = looks_of(study, panel.arms), _note(study, panel)
    yield "success", lambda: success.success_rates(panel, looks, note, study.axes.get(SCENE, ()))


def _table1(study: Study) -> Figures:
    flights = flown.flights_of(study)
    panel = study_panel(study, (shown.RATE, shown.CONTACTS, shown.CLEARANCE))
    looks, reference = looks_of(study, panel.arms), read_reference(study.name)
    note, threshold_m = _note(study, panel), _safety_threshold_m(flights)
    scenes = flown.scenes_of(study, flights)
    shared = cache(partial(flown.shared_world, study, flown.stored(study, flights), flown.three_arms(study)))
    first = scenes[0]
    yield "success", lambda: success.success_rates(panel, looks, note, study.axes.get(SCENE, ()))
    yield "figure_3", lambda: paths.flight_paths("figure_3", shared(first), looks)
    if len(scenes) > 1:
        yield "figure_4", lambda: paths.flight_paths("figure_4", shared(scenes[-1]), looks)
    yield "figure_5", lambda: over_time.path_and_tracking("figure_5", shared(first), looks)
    if panel.has(shown.CONTACTS):
        yield "figure_6", lambda: safety.collisions(panel, reference, note)
    if panel.has(shown.CLEARANCE):
        yield "figure_7", lambda: safety.minimum_clearance(panel, looks, reference, threshold_m, note)
    yield "figure_8", lambda: over_time.clearance_over_time("figure_8", shared(first), looks, threshold_m)
    if not study.replans.empty and "completion_time_s" in flights:
        yield "figure_9", lambda: _raster(study, flights, first)
    yield "figure_10", lambda: _attribution(study, flights)


def _raster(study: Study, flights: pd.DataFrame, scene: str) -> Drawing | None:
    """When the arms replanned, the clock's first."""
    clock, primary = clock_arm(study), primary_arm(study)
    ordered = sorted(flown.arms_of(study), key=lambda arm: (arm != clock, arm != primary))
    return replans.replan_raster(flights, study.replans, ordered, scene)


def _attribution(study: Study, flights: pd.DataFrame) -> Drawing | None:
    """Which change of the map fired each replan of a flight of the primary arm."""
    primary, there = primary_arm(study), flown.stored(study, flights)
    for shared in flown.shared_worlds(study, there, [primary], flown.scenes_of(study, flights)):
        if attribution.is_fired_by_map(shared.logs[primary]):
            return attribution.attribution(primary, shared)
    raise RecordError(f"no stored flight of {primary} has a replan fired by a change of the map")


def _tradeoff(study: Study) -> Figures:
    flights, panel = flown.flights_of(study), study_panel(study, _PLANE)
    curves = tradeoff.curves_of(study, flights, panel)
    yield (
        "tradeoff",
        lambda: tradeoff.plane(
            panel,
            curves,
            looks_of(study, [curve.name for curve in curves]),
            name="tradeoff",
            about="Success and least clearance against replans per mission, a curve per policy.",
            note=_note(study, panel),
        ),
    )


def _policies(study: Study) -> Figures:
    panel = study_panel(study, (*_PLANE, *policies.METRICS))
    yield (
        "policies",
        lambda: tradeoff.plane(
            panel,
            [tradeoff.single(arm) for arm in panel.arms],
            looks_of(study, panel.arms),
            name="policies",
            about="Success and least clearance against replans per mission, a point per policy.",
            note=_note(study, panel),
        ),
    )
    yield "policies_replans", lambda: policies.replanning_bars(panel, _note(study, panel))


def _robustness(study: Study) -> Figures:
    panel = study_panel(study, (shown.RATE,))
    yield from list(robustness.disturbances(study, _note(study, panel))) or _summary(study)


def _arms(study: Study) -> Figures:
    metrics = metrics_of(study)
    panel = study_panel(study, metrics)
    looks, note = looks_of(study, panel.arms), _note(study, panel)
    yield "metrics", lambda: metric_panels(panel, metrics, read_reference(study.name), looks, note)
    yield "convergence", lambda: convergence.convergence(study, panel.arms, looks, note)
    if any(metric.column.startswith("plan_") for metric in metrics):
        yield "first_plans", lambda: _first_plans(study, panel.arms)
    yield "plans", lambda: inspected.plans(study, note)
    yield "coverage_over_time", lambda: inspected.over_time(study, panel.arms, looks, note)


def _first_plans(study: Study, arms: tuple[str, ...]) -> Drawing | None:
    """The plans of all arms in the first world that all left a log of; None where none did."""
    flights = flown.flights_of(study)
    scenes = flown.scenes_of(study, flights)
    shared = next(flown.shared_worlds(study, flown.stored(study, flights), arms, scenes), None)
    return None if shared is None else plans.first_plans(shared, looks_of(study, arms))


_KINDS: dict[str, Callable[[Study], Figures]] = {
    "table1": _table1,
    "tradeoff": _tradeoff,
    "policies": _policies,
    "robustness": _robustness,
    "arms": _arms,
    "": _summary,
}


def _note(study: Study, panel: Panel) -> str:
    return circumstances(study, panel)[0]


def _safety_threshold_m(flights: pd.DataFrame) -> float:
    known = (
        flights["safety_threshold_m"].dropna() if "safety_threshold_m" in flights else pd.Series(dtype=float)
    )
    return float(known.iloc[0]) if len(known) else _SAFETY_M

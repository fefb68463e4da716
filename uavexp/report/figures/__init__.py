"""The figures of a report: drawn from what the study has; those that need logs it lacks are left out."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import pandas as pd

from uavexp.report import shown, style
from uavexp.report.arms import metrics_of
from uavexp.report.comparison import SCENE, Panel
from uavexp.report.figures import (
    attribution,
    convergence,
    flown,
    over_time,
    paths,
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
from uavexp.study import Study

_PLANE = (shown.RATE, shown.CLEARANCE, shown.REPLANS)
_SAFETY_M = 0.30  # m; where a study does not say (`metrics.summary`)


def drawings_of(study: Study) -> Iterator[Drawing]:
    """Draw the figures of a study, one after the other.

    Args:
        study: read; `study.report` says which figures are drawn.
    """
    parts = _KINDS.get(study.report, _summary)(study)
    while True:
        with style.house_style():  # not around `yield`: it would hold for whoever draws in between
            drawing = next(parts, None)
        if drawing is None:
            return
        yield drawing


def _summary(study: Study) -> Iterator[Drawing]:
    panel = study_panel(study, (shown.RATE,))
    yield success.success_rates(
        panel, looks_of(study, panel.arms), _note(study, panel), study.axes.get(SCENE, ())
    )


def _table1(study: Study) -> Iterator[Drawing]:
    flights = flown.flights_of(study)
    panel = study_panel(study, (shown.RATE, shown.CONTACTS, shown.CLEARANCE))
    looks, reference = looks_of(study, panel.arms), read_reference(study.name)
    note, threshold_m = _note(study, panel), _safety_threshold_m(flights)
    first, last = _first_and_last(study, flights)
    yield success.success_rates(panel, looks, note, study.axes.get(SCENE, ()))
    for name, shared in (("figure_3", first), ("figure_4", last)):
        if shared:
            yield paths.flight_paths(name, shared, looks)
    if first:
        yield over_time.path_and_tracking("figure_5", first, looks)
    if panel.has(shown.CONTACTS):
        yield safety.collisions(panel, reference, note)
    if panel.has(shown.CLEARANCE):
        yield safety.minimum_clearance(panel, looks, reference, threshold_m, note)
    if first:
        yield over_time.clearance_over_time("figure_8", first, looks, threshold_m)
    yield from _events(study, flights)


def _first_and_last(
    study: Study, flights: pd.DataFrame
) -> tuple[flown.SharedWorld | None, flown.SharedWorld | None]:
    """A world of the first and one of the last scene, flown by the three strategies; None without logs."""
    scenes, arms = flown.scenes_of(study, flights), flown.three_arms(study)
    there = flown.stored(study, flights)
    first = next(flown.shared_worlds(study, there, arms, scenes[:1]), None)
    last = next(flown.shared_worlds(study, there, arms, scenes[1:][-1:]), None)
    return first, last


def _events(study: Study, flights: pd.DataFrame) -> Iterator[Drawing]:
    """Figures 9 and 10: when the arms replanned and which change of the map fired it."""
    scenes, arms = flown.scenes_of(study, flights), flown.arms_of(study)
    ordered = sorted(arms, key=lambda arm: (arm != clock_arm(study), arm != primary_arm(study)))
    if not study.replans.empty and "completion_time_s" in flights:
        raster = replans.replan_raster(flights, study.replans, ordered, scenes[0])
        yield from (raster,) if raster else ()
    primary = primary_arm(study)
    for shared in flown.shared_worlds(study, flown.stored(study, flights), [primary], scenes):
        if attribution.is_fired_by_map(shared.logs[primary]):
            yield attribution.attribution(primary, shared)
            return


def _tradeoff(study: Study) -> Iterator[Drawing]:
    flights, panel = flown.flights_of(study), study_panel(study, _PLANE)
    curves = tradeoff.curves_of(study, flights, panel)
    yield tradeoff.plane(
        panel,
        curves,
        looks_of(study, [curve.name for curve in curves]),
        name="tradeoff",
        about="Success and least clearance against replans per mission, a curve per policy.",
        note=_note(study, panel),
    )


def _policies(study: Study) -> Iterator[Drawing]:
    panel = study_panel(study, (*_PLANE, *policies.METRICS))
    yield tradeoff.plane(
        panel,
        [tradeoff.single(arm) for arm in panel.arms],
        looks_of(study, panel.arms),
        name="policies",
        about="Success and least clearance against replans per mission, a point per policy.",
        note=_note(study, panel),
    )
    yield policies.replanning_bars(panel, _note(study, panel))


def _robustness(study: Study) -> Iterator[Drawing]:
    panel = study_panel(study, (shown.RATE,))
    drawings = list(robustness.disturbances(study, _note(study, panel)))
    yield from drawings or _summary(study)


def _arms(study: Study) -> Iterator[Drawing]:
    metrics = metrics_of(study)
    panel = study_panel(study, metrics)
    looks, note = looks_of(study, panel.arms), _note(study, panel)
    yield metric_panels(panel, metrics, read_reference(study.name), looks, note)
    falling = convergence.convergence(study, panel.arms, looks, note)
    yield from (falling,) if falling else ()


_KINDS: dict[str, Callable[[Study], Iterator[Drawing]]] = {
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

"""The claims of §4.5 that were never tested: sensor noise, latency and drift."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import pandas as pd

from uavexp.report import cells, shown
from uavexp.report.comparison import (
    FEWEST_SCENES,
    Difference,
    Metric,
    Panel,
    compare,
    estimate,
    pairs_of,
    panel_of,
)
from uavexp.report.findings import (
    FAILED,
    INTERVALS,
    OK,
    Findings,
    arm_axes,
    arms_flown,
    arms_table,
    circumstances,
    values_table,
)
from uavexp.report.paired import PairedTest, evidence, paired_tests, verdict
from uavexp.report.parts import Claim, Table, Verdict
from uavexp.report.statistics import Interval
from uavexp.store.study import Study

ARM = "arm"
NOISE, LATENCY, DRIFT = "noise", "latency", "drift"
SMALL_NOISE, MODERATE_LATENCY, SEVERE_DRIFT = "small_noise", "moderate_latency", "severe_drift"
_JUDGED = {SMALL_NOISE: NOISE, MODERATE_LATENCY: LATENCY, SEVERE_DRIFT: DRIFT}  # settings: the level judged
FALSE_TRIGGERS = Metric(column="false_triggers_per_min", label="False triggers [1/min]", digits=2, better=-1)
MAP_REPLANS = Metric(column="replans_map", label="Replans, cause map", digits=1, is_count=True)
METRICS = (
    shown.RATE,
    shown.CONTACTS,
    shown.CLEARANCE,
    shown.TRACKING,
    shown.REPLANS,
    MAP_REPLANS,
    FALSE_TRIGGERS,
)
USEFUL_CHANGE_M = 0.10  # m; a replan that departs less from the old path was wasted (`metrics.summary`)
_FALSE = "False trigger: a replan for a change of the map that moved the path by less than 0.1 m."
_NONE = (
    "After the semicolon: level minus the undisturbed one of its axis in the same worlds, with the p value "
    "of sign flips of whole scenes, not corrected. The other axes are undisturbed."
)

_TUNED_FOR = (shown.RATE, shown.CLEARANCE, FALSE_TRIGGERS)


@dataclass(frozen=True, slots=True, kw_only=True)
class Levels:
    """One disturbance at each of its levels, every other one absent."""

    axis: str
    none: str  # the undisturbed level
    panel: Panel  # a column per level, the undisturbed one among them


def findings(study: Study) -> Findings:
    """Every level against none, every cell, and the claims of §4.5."""
    trials = with_false_triggers(study.trials, study.replans)
    axes = arm_axes(study)
    panel = panel_of(trials, tuple(axes), arms_flown(trials, axes), METRICS)
    levels = [found for axis in axes if axis != ARM and (found := _levels(study, trials, axis))]
    notes = (*circumstances(study, panel), _FALSE)
    return Findings(
        tables=(
            _levels_table(levels, notes),
            arms_table(panel, METRICS, name="cells", title="Every combination", notes=notes),
        ),
        claims=(*_claims(study, {item.axis: item for item in levels}), *_tuned(study, trials), _EMBEDDED),
        values=(values_table(panel, METRICS),),
    )


def with_false_triggers(trials: pd.DataFrame, replans: pd.DataFrame) -> pd.DataFrame:
    """The trials with the column `false_triggers_per_min`; NaN for those that did not run to their end."""
    end_s = trials.set_index("trial")["completion_time_s"].astype(float)
    wasted = (
        (replans["cause"] == "map")
        & (replans["number"] > 0)
        & (replans["status"] == OK)
        & (replans["effective_s"] <= replans["trial"].map(end_s))
        & (replans["path_change_m"] <= USEFUL_CHANGE_M)
    )
    count = trials["trial"].map(replans.loc[wasted, "trial"].value_counts()).fillna(0.0).astype(float)
    minutes = trials["completion_time_s"].astype(float) / 60.0
    return trials.assign(**{FALSE_TRIGGERS.column: count / minutes.where(minutes > 0.0)})


def _levels(study: Study, trials: pd.DataFrame, axis: str) -> Levels | None:
    """One axis by itself, flown by the primary arm; None without its undisturbed level."""
    alone = pd.Series(True, index=trials.index)
    for other in arm_axes(study).keys() - {axis}:
        alone &= trials[other].astype(str) == (_primary(study) if other == ARM else _none(study, other))
    arms = arms_flown(trials[alone], {axis: study.axes[axis]})
    none = _none(study, axis)
    if none not in arms:
        return None
    return Levels(axis=axis, none=none, panel=panel_of(trials[alone], (axis,), arms, METRICS))


def _none(study: Study, axis: str) -> str:
    """The level of an axis at which it disturbs nothing (`settings.none`; by default the first)."""
    return str(study.settings.get("none", {}).get(axis, study.axes[axis][0]))


def _level(study: Study, name: str, otherwise: int) -> str:
    """The level that a claim is about (`settings`; by default that place of its axis)."""
    axis = _JUDGED[name]
    return str(study.settings.get(name, study.axes[axis][otherwise]))


def _levels_table(levels: Sequence[Levels], notes: Sequence[str]) -> Table:
    shown_here = [metric for metric in METRICS if all(item.panel.has(metric) for item in levels)]

    def row(item: Levels, level: str) -> tuple[str, ...]:
        changes = (_level_cell(item, metric, level) for metric in shown_here)
        return (item.axis, level, str(item.panel.n(level)), *changes)

    return Table(
        name="levels",
        title="Noise, latency and drift, one at a time",
        columns=("axis", "level", "n", *(metric.label for metric in shown_here)),
        rows=tuple(row(item, level) for item in levels for level in item.panel.arms),
        notes=(*notes, _NONE, INTERVALS, FAILED),
    )


def _level_cell(item: Levels, metric: Metric, level: str) -> str:
    """Mean at a level, and its difference from none."""
    found = estimate(item.panel, metric, level)
    mean = cells.mean_with_interval(found, metric, item.panel.n(level))
    if level == item.none:
        return mean
    change = compare(pairs_of(item.panel, level, item.none, [metric]), metric)
    return f"{mean}; {cells.difference(change, metric)}, p = {cells.p_value(change.p)}"


def _claims(study: Study, levels: dict[str, Levels]) -> Iterator[Claim]:
    margins = {
        FALSE_TRIGGERS.column: float(study.settings.get("false_triggers_per_min", 1.0)),
        shown.RATE.column: float(study.settings.get("success_percent", 5.0)),
    }
    for name, metric, otherwise, statement in (
        (SMALL_NOISE, FALSE_TRIGGERS, 1, "Small sensor noise ({level}) does not fire the trigger"),
        (MODERATE_LATENCY, shown.RATE, 1, "Moderate latency ({level}) does not destabilise"),
    ):
        if item := _disturbed(study, levels, name, otherwise):
            yield _no_worse(item, _level(study, name, otherwise), metric, margins[metric.column], statement)
    if item := _disturbed(study, levels, SEVERE_DRIFT, -1):
        yield _degrades(item, _level(study, SEVERE_DRIFT, -1))


def _disturbed(study: Study, levels: Mapping[str, Levels], name: str, otherwise: int) -> Levels | None:
    """The axis of a claim, if it was flown at the level that the claim is about."""
    item = levels.get(_JUDGED[name])
    if item is None or _level(study, name, otherwise) not in item.panel.arms:
        return None
    return item if _level(study, name, otherwise) != item.none else None


def _no_worse(item: Levels, level: str, metric: Metric, margin: float, statement: str) -> Claim:
    """A level against none: worse by less than a margin, worse, or undecided."""
    found = compare(pairs_of(item.panel, level, item.none, [metric]), metric)
    worse = Interval(*sorted(-metric.better * end for end in _ends(found)))
    if worse.high < margin:
        judged = Verdict.REPRODUCED
    else:
        judged = Verdict.NOT_REPRODUCED if worse.low > 0.0 else Verdict.NOT_TESTABLE
    return Claim(
        statement=statement.format(level=level),
        source="§4.5",
        verdict=judged,
        evidence=f"{metric.label} against {item.none}: {cells.difference(found, metric)}, "
        f"{found.pairs} pairs; reproduced when the interval rules out a worsening by {margin:g}, not "
        "reproduced when it shows a worsening and does not rule that out, else undecided",
    )


def _ends(found: Difference) -> Interval:
    """Interval of a difference; where it is the same in every pair, as when nothing happened, itself."""
    alike = math.isnan(found.interval.low) and found.units >= FEWEST_SCENES
    return Interval(found.mean, found.mean) if alike else found.interval


def _degrades(item: Levels, level: str) -> Claim:
    """A drift against none, in success and clearance: less is claimed."""
    tests = paired_tests(item.panel, (shown.RATE, shown.CLEARANCE), [(item.none, level)])
    return Claim(
        statement=f"Severe drift ({level}) degrades the map: less success or clearance",
        source="§4.5",
        verdict=_any_better(tests),
        evidence="; ".join(map(evidence, tests)) + f"; p times {len(tests)} for the verdict",
    )


def _tuned(study: Study, trials: pd.DataFrame) -> Iterator[Claim]:
    """Other thresholds (axis `arm`) against the primary ones under severe drift alone."""
    axes = arm_axes(study)
    if DRIFT not in axes or len(axes.get(ARM, ())) < 2:
        return
    severe = _level(study, SEVERE_DRIFT, -1)
    drifting = pd.Series(True, index=trials.index)
    for axis in axes.keys() - {ARM}:
        drifting &= trials[axis].astype(str) == (severe if axis == DRIFT else _none(study, axis))
    arms = arms_flown(trials[drifting], {ARM: axes[ARM]})
    panel = panel_of(trials[drifting], (ARM,), arms, METRICS)
    primary = _primary(study)
    for other in (arm for arm in arms if arm != primary and primary in arms):
        tests = paired_tests(panel, _TUNED_FOR, [(other, primary)])
        yield Claim(
            statement=f"The threshold can be tuned against drift: {other} is better than {primary} under "
            f"{severe} drift",
            source="§4.5",
            verdict=_any_better(tests),
            evidence="; ".join(map(evidence, tests)) + f"; p times {len(tests)} for the verdict",
        )


def _any_better(tests: Sequence[PairedTest]) -> Verdict:
    """Whether one of several tests finds the claimed sign, corrected for their number (Bonferroni)."""
    corrected = [replace(test, p=min(1.0, len(tests) * test.found.p)) for test in tests]
    found = {verdict(test, test.metric.better) for test in corrected}
    return min(found, key=list(Verdict).index)


def _primary(study: Study) -> str:
    return str(study.settings.get("primary", arm_axes(study)[ARM][0]))


_EMBEDDED = Claim(
    statement="The replanner fits an embedded CPU",
    source="§4.5",
    verdict=Verdict.NOT_TESTABLE,
    evidence="no embedded CPU here; this machine's times are in trials.parquet, wall_optimise_median_s",
)

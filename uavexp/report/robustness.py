"""The claims of §4.5 that were never tested: sensor noise, latency and drift."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import pandas as pd

from uavexp.report import cells, shown
from uavexp.report.comparison import Metric, Panel, compare, estimate, pairs_of, panel_of
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
from uavexp.study import Study

ARM = "arm"
NOISE, LATENCY, DRIFT = "noise", "latency", "drift"
FALSE_TRIGGERS = Metric(column="false_triggers_per_min", label="False triggers [1/min]", digits=2, better=-1)
MAP_REPLANS = Metric(column="replans_map", label="Replans, cause map", digits=1)
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
    "After the semicolon: level minus the first one of its axis (none) in the same worlds, with the p value "
    "of sign flips of whole scenes, not corrected. The other axes are at their first level."
)


_TUNED_FOR = (shown.RATE, shown.CLEARANCE, FALSE_TRIGGERS)


@dataclass(frozen=True, slots=True, kw_only=True)
class Levels:
    """One disturbance at each of its levels, every other one at its first."""

    axis: str
    panel: Panel  # a column per level, the undisturbed one first

    @property
    def none(self) -> str:
        """The undisturbed level."""
        return self.panel.arms[0]


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
    for other, values in arm_axes(study).items():
        if other != axis:
            alone &= trials[other].astype(str) == (_primary(study) if other == ARM else values[0])
    arms = arms_flown(trials[alone], {axis: study.axes[axis]})
    if not arms or arms[0] != study.axes[axis][0]:
        return None
    return Levels(axis=axis, panel=panel_of(trials[alone], (axis,), arms, METRICS))


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
    if NOISE in levels and len(levels[NOISE].panel.arms) > 1:
        yield _no_worse(
            levels[NOISE],
            FALSE_TRIGGERS,
            margins[FALSE_TRIGGERS.column],
            "Small sensor noise ({level}) does not fire the trigger",
        )
    if LATENCY in levels and len(levels[LATENCY].panel.arms) > 1:
        yield _no_worse(
            levels[LATENCY],
            shown.RATE,
            margins[shown.RATE.column],
            "Moderate latency ({level}) does not destabilise",
        )
    if DRIFT in levels and len(levels[DRIFT].panel.arms) > 1:
        yield _degrades(levels[DRIFT])


def _no_worse(item: Levels, metric: Metric, margin: float, statement: str) -> Claim:
    """The first disturbed level against none: worse by less than a margin, worse, or undecided."""
    level = item.panel.arms[1]
    found = compare(pairs_of(item.panel, level, item.none, [metric]), metric)
    worse = Interval(*sorted(-metric.better * end for end in found.interval))
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


def _degrades(item: Levels) -> Claim:
    """The hardest drift against none, in success and clearance: less is claimed."""
    level = item.panel.arms[-1]
    tests = paired_tests(item.panel, (shown.RATE, shown.CLEARANCE), [(item.none, level)])
    return Claim(
        statement=f"Severe drift ({level}) degrades the map: less success or clearance",
        source="§4.5",
        verdict=_any_better(tests),
        evidence="; ".join(map(evidence, tests)) + f"; p times {len(tests)} for the verdict",
    )


def _tuned(study: Study, trials: pd.DataFrame) -> Iterator[Claim]:
    """Other thresholds (axis `arm`) against the primary ones under the hardest drift alone."""
    axes = arm_axes(study)
    if DRIFT not in axes or len(axes.get(ARM, ())) < 2:
        return
    hardest = pd.Series(True, index=trials.index)
    for axis in axes.keys() - {ARM}:
        hardest &= trials[axis].astype(str) == axes[axis][-1 if axis == DRIFT else 0]
    arms = arms_flown(trials[hardest], {ARM: axes[ARM]})
    panel = panel_of(trials[hardest], (ARM,), arms, METRICS)
    primary = _primary(study)
    for other in (arm for arm in arms if arm != primary and primary in arms):
        tests = paired_tests(panel, _TUNED_FOR, [(other, primary)])
        yield Claim(
            statement=f"The threshold can be tuned against drift: {other} is better than {primary} under "
            f"{axes[DRIFT][-1]} drift",
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

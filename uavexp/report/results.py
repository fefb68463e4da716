"""What tables, figures and judges are made of: a study's trials by world and arm, and the paper's numbers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import pandas as pd

from uavexp.metrics.metric import Metric
from uavexp.metrics.replanning import cause_of
from uavexp.report.comparison import FEWEST_SCENES, SCENE, Panel, arm_names, panel_of
from uavexp.report.derived import with_derived
from uavexp.report.labels import with_own_causes
from uavexp.report.paired import PairedTest, paired_tests
from uavexp.report.printed import Reference, read_reference
from uavexp.report.significance import holm
from uavexp.store.study import Study
from uavexp.store.table import pooled_versions

Sentence = tuple[tuple[Metric, str, str], ...]  # metric, first and second arm of each comparison
ARM = "arm of all axes"  # column of `Results.trials`; an axis may be called "arm"
OK = "ok"  # status of a trial that ran to its end

INTERVALS = (
    "In brackets 95 % intervals. Rates: Wilson's, with the effective number of trials in scenes. Means: "
    "bootstrap, scenes resampled, then seeds within them, percentiles widened for the number of scenes. "
    "Where all values are equal there is nothing to resample and no interval stands; a count that was zero "
    "in every flight has the exact Poisson bound instead, 3.7 / n."
)
FAILED = (
    "n counts every trial. One that did not run to its end (killed, out of time or memory) is a failure in "
    "the success rate and has no other metric; means over fewer trials name their n. Lengths, times, "
    "tracking and smoothness of an arm of which fewer than half of the flights succeeded are dashes: they "
    "would be those of flights cut short, or of a vehicle left behind."
)


@dataclass(frozen=True, kw_only=True, eq=False)
class Results:
    """The trials of a study, or of one part of it, with everything that is read from them once."""

    study: Study
    among: Mapping[str, str] = field(default_factory=dict)  # axis -> the one value looked at
    shown: tuple[Metric, ...] = ()  # resampled together, which is faster than one by one
    compared: tuple[Metric, ...] = ()  # in which arms are tested against each other
    asked: tuple[tuple[str, str], ...] = ()  # pairs of arms that claims are about
    sentences: tuple[Sentence, ...] = ()  # comparisons that bear a sentence together

    def only(self, among: Mapping[str, str], *, but: str = "") -> Results:
        """The part in which each axis named, `but` one, has the one value; it names no arm any more."""
        chosen = {axis: value for axis, value in among.items() if axis != but and axis in self.arm_axes}
        return Results(study=self.study, among={**self.among, **chosen}, shown=self.shown)

    @cached_property
    def arm_axes(self) -> dict[str, tuple[str, ...]]:
        """Axes that tell arms apart, with their values: all but the scenes and those with one value."""
        axes = self.study.axes.items()
        return {axis: values for axis, values in axes if axis != SCENE and axis not in self.among}

    @cached_property
    def trials(self) -> pd.DataFrame:
        """A row per trial: the study's columns, derived metrics, the arm's name (`ARM`), and a scene."""
        trials = with_derived(self.study, self.shown)
        for axis, value in self.among.items():
            trials = trials[trials[axis].astype(str) == value]
        scene = trials[SCENE].astype(str) if SCENE in trials else pd.Series("", index=trials.index)
        return trials.assign(**{ARM: arm_names(trials, tuple(self.arm_axes)), SCENE: scene})

    @cached_property
    def arms(self) -> tuple[str, ...]:
        """Names of the arms in the order of their axes, those without a trial left out."""
        places = [{value: n for n, value in enumerate(values)} for values in self.arm_axes.values()]

        def order(row: tuple[str, ...]) -> list[tuple[int, str]]:
            return [(place.get(value, len(place)), value) for place, value in zip(places, row, strict=True)]

        flown = self.trials[list(self.arm_axes)].astype(str).drop_duplicates()
        rows = sorted(flown.itertuples(index=False, name=None), key=order)
        return tuple(", ".join(filter(None, row)) for row in rows)

    def levels(self, axis: str) -> tuple[str, ...]:
        """Values of one of the axes of arms that were flown, in the experiment's order."""
        flown = set(self.trials[axis].astype(str))
        return tuple(value for value in self.arm_axes[axis] if value in flown)

    @cached_property
    def scenes(self) -> tuple[str, ...]:
        """Scenes with a trial, in the experiment's order; none where the study has no such axis."""
        flown = set(self.trials[SCENE])
        return tuple(scene for scene in self.study.axes.get(SCENE, ()) if scene in flown)

    @cached_property
    def panel(self) -> Panel:
        """All trials by world and arm."""
        return panel_of(self.trials, ARM, self.arms, together=self.shown)

    @cached_property
    def printed(self) -> Reference:
        """The paper's numbers."""
        return read_reference(self.study.name)

    @property
    def primary(self) -> str:
        """The arm that the others are compared with (`settings.primary`)."""
        return str(self.study.settings.get("primary", next(iter(self.arms), "")))

    @property
    def clock(self) -> str:
        """The arm that replans by the clock as a paper does (`settings.time_based`)."""
        return str(self.study.settings.get("time_based", "TBR"))

    @cached_property
    def comparisons(self) -> tuple[tuple[str, str], ...]:
        """Pairs of arms: the primary one and each other, then those that claims are about."""
        arms = self.arms
        others = [(self.primary, arm) for arm in arms if arm != self.primary] if self.primary in arms else []
        return tuple(dict.fromkeys([*others, *(pair for pair in self.asked if set(pair) <= set(arms))]))

    @cached_property
    def tests(self) -> tuple[PairedTest, ...]:
        """Every comparison in every metric compared, corrected for their number."""
        return paired_tests(self.panel, self.compared, self.comparisons)

    def borne(self, test: PairedTest) -> tuple[float, int]:
        """P of a comparison, Holm-corrected over those that bear a sentence with it, and their number.

        Where it bears none, as it is corrected over its metric, and 0.
        """
        mine = (test.metric, test.first, test.second)
        family = next((sentence for sentence in self.sentences if mine in sentence), ())
        p = {
            (one.metric, one.first, one.second): one.found.p
            for one in self.tests
            if one.both_succeeded == one.metric.needs_arrival
        }
        there = [one for one in family if one in p]
        if mine not in there:
            return test.p, 0
        return float(holm(np.array([p[one] for one in there]))[there.index(mine)]), len(there)

    def occurring(self, metrics: Sequence[Metric]) -> list[Metric]:
        """The metrics that the trials have, without causes of replanning that never occurred.

        Where all shipped causes are asked for, causes of one's own follow them.
        """
        return [
            metric
            for metric in with_own_causes(metrics, self.trials.columns)
            if self.panel.has(metric)
            and (cause_of(metric) is None or np.nansum(self.panel.block(metric)) > 0.0)
        ]

    @cached_property
    def notes(self) -> tuple[str, ...]:
        """Sentences below every table: seeds, scenes, how unknown space is planned through."""
        trials, scenes = self.study.measurements, self.panel.scenes
        seeds = np.sort(trials["seed"].unique())
        among = f" in {len(scenes)} scenes" if len(scenes) > 1 else ""
        notes = [f"{len(trials)} trials{among}, {seeds.size} seeds ({seeds[0]} to {seeds[-1]})."]
        if 1 < len(scenes) < FEWEST_SCENES:
            notes.append(_FEW_SCENES)
        if "p_planner_unknown" in trials:
            ways = sorted(trials["p_planner_unknown"].dropna().astype(str).unique())
            notes.append(f"Unknown space in plans: {', '.join(ways)}.")
        marks = [name for name in ("code", "lock") if name in trials]
        versions = trials[marks].fillna("").itertuples(index=False, name=None)
        if marks and (pooled := pooled_versions(versions)):
            notes.append(pooled)
        if "status" in trials and (failed := int((trials["status"] != OK).sum())):
            notes.append(f"{failed} trials did not run to their end.")
        return tuple(notes)


_FEW_SCENES = (
    f"Fewer than {FEWEST_SCENES} scenes: each world counts as independent in intervals and tests, which "
    "speak of further seeds in these scenes, not of other scenes."
)

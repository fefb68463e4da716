"""Judges: whether what a paper claims of its arms holds here, and the numbers that this rests on.

A claim in an experiment's file names its judge; the judge's arguments are the claim's other keys. The
first of `arms` is the one that the claim speaks for.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np

from uavexp.metrics.metric import Metric
from uavexp.report import number_format, statistics
from uavexp.report.comparison import (
    FEWEST_SCENES,
    Difference,
    compare,
    estimate,
    interval_of,
    pairs_of,
)
from uavexp.report.labels import CLEARANCE, RATE, REPLANS, metrics_of
from uavexp.report.paired import PairedTest, paired_tests
from uavexp.report.results import Results
from uavexp.report.significance import ALPHA, holm, sign_flip_p, smallest_p
from uavexp.report.statistics import Interval

(_TIME,) = metrics_of(("completion_time_s",))

RULE = (
    "A claimed direction is reproduced when the difference has that sign and its p value (sign flips of "
    "whole scenes, two-sided, Holm-corrected over the comparisons of one metric, or over all claims that "
    "bear a sentence with it) is below 0.05, contradicted when it has the other sign and such a p value, "
    "else not shown; not testable without the trials or with so few scenes that no p value could be below "
    "0.05. A printed number is reproduced when the whole 95 % interval lies within the claim's margin of "
    "it, contradicted when none of it does, else not shown: few flights show nothing. Lengths, times, "
    "tracking and smoothness are judged where both arms succeeded: a path cut short by failure is not a "
    "shorter path."
)


class Verdict(StrEnum):
    """Whether a claim of the paper holds here."""

    REPRODUCED = "reproduced"
    CONTRADICTED = "contradicted"  # what is flown shows that it does not
    NOT_SHOWN = "not shown"  # what is flown shows neither
    NOT_TESTABLE = "not testable"


Ruling = tuple[Verdict, str]  # with the numbers it rests on, or the reason why it cannot be tested


def better(results: Results, *, arms: Sequence[str], metric: Metric) -> Ruling:
    """The first arm is better than the second (`RULE`)."""
    first, second = arms
    tests = results.tests if (first, second) in results.comparisons else ()
    for test in tests or paired_tests(results.panel, [metric], [(first, second)]):
        same = (test.metric, test.first, test.second) == (metric, first, second)
        if same and test.both_succeeded == metric.needs_arrival:
            p, claims = results.borne(test)
            borne = f", Holm over the {claims} claims of its sentence" if claims else ""
            return _direction(judged := replace(test, p=p)), _numbers(judged) + borne
    return Verdict.NOT_TESTABLE, "the trials do not have it"


def better_in_any(results: Results, *, arms: Sequence[str], metrics: Sequence[Metric]) -> Ruling:
    """The first arm is better than the second in one of the metrics (Bonferroni-corrected)."""
    first, second = arms
    tests = [
        test for test in paired_tests(results.panel, metrics, [(first, second)]) if not test.both_succeeded
    ]
    corrected = [replace(test, p=min(1.0, len(tests) * test.found.p)) for test in tests]
    numbers = "; ".join(map(_numbers, tests))
    return _in_any(set(map(_direction, corrected))), f"{numbers}; p times {len(tests)} for the verdict"


def _in_any(found: set[Verdict]) -> Verdict:
    """What holds of any of several: reproduced if one is, contradicted if all that can be tested are."""
    tested = found - {Verdict.NOT_TESTABLE}
    if Verdict.REPRODUCED in tested or not tested:
        return Verdict.REPRODUCED if tested else Verdict.NOT_TESTABLE
    return Verdict.CONTRADICTED if tested == {Verdict.CONTRADICTED} else Verdict.NOT_SHOWN


def _direction(test: PairedTest) -> Verdict:
    if not test.found.pairs or smallest_p(test.found.units) > ALPHA:
        return Verdict.NOT_TESTABLE
    if test.p >= ALPHA:
        return Verdict.NOT_SHOWN
    return Verdict.REPRODUCED if test.found.mean * test.metric.better > 0.0 else Verdict.CONTRADICTED


def _numbers(test: PairedTest) -> str:
    found, digits = test.found, test.metric.digits
    if not found.pairs:
        return "no worlds in which both arms succeeded" if test.both_succeeded else "no common worlds"
    shown = "" if test.p < ALPHA else " (none shown)"
    among = ", both succeeded" if test.both_succeeded else ""
    few = "" if smallest_p(found.units) <= ALPHA else f"; p cannot be below {smallest_p(found.units):.2g}"
    return (
        f"{test.metric.label}: {number_format.number(found.first_mean, digits)} ({test.first}) against "
        f"{number_format.number(found.second_mean, digits)} ({test.second}), difference "
        f"{number_format.difference(found, test.metric)}{shown}, p = {number_format.p_value(test.p)}, "
        f"{found.pairs} pairs{among}{few}"
    )


def no_worse(results: Results, *, arms: Sequence[str], metric: Metric, margin: float) -> Ruling:
    """The first arm is worse than the second by less than a margin (in the unit shown)."""
    first, second = arms
    found = compare(pairs_of(results.panel, first, second, [metric]), metric)
    ends = _ends(found, _rare(results, first, metric))
    worse = Interval(*sorted(-metric.better * end for end in ends))
    return _within(Interval(-math.inf, margin), worse), (
        f"{metric.label} against {second}: {number_format.difference(found, metric)}, {found.pairs} pairs; "
        f"reproduced when the interval rules out a worsening by {margin:g}, contradicted when it shows one"
    )


def _rare(results: Results, arm: str, metric: Metric) -> float:
    """What a mean may yet be off by where all flights are alike: of events that are too rare to occur.

    Infinite for what is neither a count nor events in a time: nothing bounds a single value of it.
    """
    exposure = float(results.panel.n(arm))
    if metric.unit == "1/min":
        exposure = float(np.nansum(results.panel.values(_TIME, arm))) / 60.0
    elif not metric.is_count:
        return math.inf
    return statistics.no_event_interval(1).high / exposure if exposure else math.inf


def _ends(found: Difference, rare: float = 0.0) -> Interval:
    """Interval of a difference; `rare` about it where it is the same in every pair."""
    if math.isnan(found.interval.low) and found.units >= FEWEST_SCENES:
        return Interval(found.mean - rare, found.mean + rare)
    return found.interval


def no_worse_in_any_scene(results: Results, *, arms: Sequence[str], metric: Metric) -> Ruling:
    """In no scene is the first arm's mean worse than the second's."""
    (first, second), scenes = arms, results.panel.scenes
    pairs = pairs_of(results.panel, first, second, [metric])
    if len(scenes) < 2:
        return Verdict.NOT_TESTABLE, "a single scene"
    gain = metric.better * pairs.columns[metric.column] @ (1.0, -1.0)
    own = [gain[pairs.scene == number] for number in range(len(scenes))]
    if not all(np.isfinite(some).any() for some in own):
        return Verdict.NOT_TESTABLE, "a scene without a world that both arms have flown"
    fewest = min(int(np.isfinite(some).sum()) for some in own)
    if len(scenes) * smallest_p(fewest, "less") > ALPHA:
        return Verdict.NOT_TESTABLE, f"{fewest} worlds in a scene: nothing in it could be shown to be worse"
    worse = [name for name, some in zip(scenes, own, strict=True) if np.nansum(some) < 0.0]
    p = holm(np.array([sign_flip_p(some, np.arange(some.size), "less") for some in own]))
    shown = np.nanmin(p, initial=1.0) < ALPHA
    verdict = Verdict.REPRODUCED if not worse else Verdict.CONTRADICTED if shown else Verdict.NOT_SHOWN
    return verdict, (
        f"less often in {len(worse)} of {len(scenes)} scenes{': ' * bool(worse)}{', '.join(worse)}; "
        f"contradicted when in one of them by more than chance, least p = "
        f"{number_format.p_value(float(np.nanmin(p, initial=1.0)))} (sign flips of trials, Holm over scenes)"
    )


def none(
    results: Results, *, arms: Sequence[str], metric: Metric, event: str, at_most_percent: float = 2.0
) -> Ruling:
    """No flight of the arm has the event that the metric counts, and at most so many percent would."""
    (arm,) = arms
    counts = results.panel.values(metric, arm)
    n, hit = int(np.isfinite(counts).sum()), int((counts > 0.0).sum())
    if not n:
        return Verdict.NOT_TESTABLE, "no flight"
    low, high = statistics.wilson_interval(hit, n)
    share, *ends = (number_format.number(100.0 * value, 1) for value in (hit / n, low, high))
    rare = 100.0 * high <= at_most_percent
    verdict = Verdict.CONTRADICTED if hit else Verdict.REPRODUCED if rare else Verdict.NOT_SHOWN
    return verdict, (
        f"{hit} of {n} flights with {event}, {share} % [{', '.join(ends)}]; reproduced when there is none "
        f"and the interval ends below {at_most_percent:g} %"
    )


def saved(
    results: Results, *, arms: Sequence[str], metric: Metric, percent: float, margin: float = 5.0
) -> Ruling:
    """The first arm has so many percent less of the metric than the second, by the ratio of the means."""
    panel, (first, second) = results.panel, arms
    means = [estimate(panel, metric, arm) for arm in arms]
    if not means[0].n or not means[1].mean > 0.0:
        return Verdict.NOT_TESTABLE, f"{second} has none"
    samples = panel.samples(metric)
    ratio = samples[:, panel.arms.index(first)] / samples[:, panel.arms.index(second)]
    ends = interval_of(100.0 * (1.0 - ratio), statistics.units_of(panel.cluster))
    found = number_format.number(100.0 * (1.0 - means[0].mean / means[1].mean), 0)
    return _within(_around(percent, margin), ends), (
        f"saved: {found} % {number_format.interval(ends, 0)}; margin {margin:g} points around {percent:g} %"
    )


def value(results: Results, *, arms: Sequence[str], metric: Metric, margin: float | None = None) -> Ruling:
    """The arm's mean is the one that the paper prints (`reference.csv`), give or take a margin.

    Args:
        results: of the study.
        arms: the arm.
        metric: whose mean is printed.
        margin: in the unit shown; by default a tenth of what is printed.
    """
    (arm,) = arms
    printed = results.printed.get((metric.column, arm))
    if printed is None:
        return Verdict.NOT_TESTABLE, "the paper prints no such number"
    found = estimate(results.panel, metric, arm)
    mean = number_format.mean_with_interval(found, metric, found.n)
    spare = 0.1 * printed.mean if margin is None else margin
    verdict = _within(_around(printed.mean, spare), found.interval)
    return verdict, f"{mean}; margin {spare:g} around {printed.mean:g}"


def _around(middle: float, margin: float) -> Interval:
    return Interval(middle - margin, middle + margin)


def _within(asked: Interval, found: Interval) -> Verdict:
    """Whether an interval lies within what is asked, beside it, or neither."""
    if math.isnan(found.low):
        return Verdict.NOT_TESTABLE
    if asked.low <= found.low and found.high <= asked.high:
        return Verdict.REPRODUCED
    beside = found.high < asked.low or found.low > asked.high
    return Verdict.CONTRADICTED if beside else Verdict.NOT_SHOWN


@dataclass(frozen=True, slots=True, kw_only=True)
class _Rival:
    """One arm against another: success, clearance, replans, and the probability of all three."""

    arm: str
    success: Difference
    clearance: Difference
    replans: Difference

    @property
    def p(self) -> float:
        """All three must hold: the largest of their p values (Berger 1982, intersection-union test)."""
        return float(np.max([self.success.p, self.clearance.p, self.replans.p]))  # NaN when one is

    def p_within(self, success_percent: float) -> float:
        """The same; 1 where so few flights leave open that success is less by the margin."""
        return self.p if self.success.interval.low > -success_percent else 1.0

    def loses(self, success_percent: float, clearance_m: float) -> bool:
        """Whether an interval rules one of the three out."""
        success, clearance, replans = (_ends(one) for one in (self.success, self.clearance, self.replans))
        return success.high < -success_percent or clearance.high < -clearance_m or replans.low > 0.0


def trade_off(
    results: Results, *, arms: Sequence[str], success_percent: float = 5.0, clearance_m: float = 0.02
) -> Ruling:
    """One of the arms before the last has as much success and clearance as that, with fewer replans.

    Args:
        results: of the study.
        arms: any number that the claim speaks for, then the one they are compared with.
        success_percent: how much less success still counts as as much.
        clearance_m: how much less clearance does.
    """
    *own, other = arms
    rivals = [_rival(results, arm, other, success_percent, clearance_m) for arm in own]
    paired = [rival for rival in rivals if math.isfinite(rival.p)]
    if not paired:
        return Verdict.NOT_TESTABLE, "no common worlds"
    corrected = holm(np.array([rival.p_within(success_percent) for rival in paired]))
    best = int(np.argmin(corrected))
    rival, p = paired[best], float(corrected[best])
    lost = all(one.loses(success_percent, clearance_m) for one in paired)
    verdict = Verdict.REPRODUCED if p < ALPHA else Verdict.CONTRADICTED if lost else Verdict.NOT_SHOWN
    if len(paired) * smallest_p(rival.success.units, "greater") > ALPHA:
        verdict = Verdict.NOT_TESTABLE
    return verdict, (
        f"nearest: {rival.arm}, success {number_format.difference(rival.success, RATE)} points, "
        f"clearance {number_format.difference(rival.clearance, CLEARANCE)} m, "
        f"replans {number_format.difference(rival.replans, REPLANS)}; p = {number_format.p_value(p)} (sign "
        f"flips of scenes for all three, success less by under {success_percent:g} points, in its whole "
        f"interval, and clearance by under {clearance_m:g} m allowed, Holm over {len(paired)} arms); "
        "contradicted when an "
        "interval rules one of the three out for every arm"
    )


def _rival(results: Results, arm: str, other: str, success_percent: float, clearance_m: float) -> _Rival:
    pairs = pairs_of(results.panel, arm, other, (RATE, CLEARANCE, REPLANS))
    return _Rival(
        arm=arm,
        success=compare(pairs, RATE, margin=success_percent, alternative="greater"),
        clearance=compare(pairs, CLEARANCE, margin=clearance_m, alternative="greater"),
        replans=compare(pairs, REPLANS, alternative="less"),
    )


def not_testable(results: Results, *, why: str) -> Ruling:
    """Nothing flown here tells; the claim says why."""
    return Verdict.NOT_TESTABLE, why


JUDGES: dict[str, Callable[..., Ruling]] = {
    judge.__name__: judge
    for judge in (
        better,
        better_in_any,
        no_worse,
        no_worse_in_any_scene,
        none,
        saved,
        value,
        trade_off,
        not_testable,
    )
}

"""Paired tests between arms, corrected for their number, and the rule that turns one into a verdict."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from uavexp.report import cells
from uavexp.report.comparison import FEWEST_SCENES, Difference, Metric, Pairs, Panel, compare, pairs_of
from uavexp.report.parts import Table, Verdict
from uavexp.report.significance import ALPHA, holm, smallest_p

RULE = (
    "A claimed direction is reproduced when the difference has that sign and its p value (sign flips of "
    "whole scenes, two-sided, Holm-corrected over the comparisons of one metric) is below 0.05; not "
    "reproduced when it has not; not testable without the trials or with so few scenes that no p value "
    "could be below 0.05. Lengths, times, tracking and smoothness are judged where both arms succeeded: a "
    "path cut short by failure is not a shorter path."
)


@dataclass(frozen=True, slots=True, kw_only=True)
class PairedTest:
    """One metric compared between two arms."""

    metric: Metric
    first: str
    second: str
    both_succeeded: bool  # only worlds in which both arms succeeded
    found: Difference
    p: float  # of `found`, Holm-corrected over the tests of the same metric


def paired_tests(
    panel: Panel, metrics: Sequence[Metric], comparisons: Sequence[tuple[str, str]]
) -> tuple[PairedTest, ...]:
    """Compare pairs of arms in every metric; a family of Holm's correction is one metric.

    Metrics that need arrival are compared twice: over all worlds as flown, and over those in
    which both arms succeeded.
    """
    shown = [metric for metric in metrics if panel.has(metric)]
    tests: dict[tuple[str, bool], list[PairedTest]] = {
        (metric.column, both): [] for metric in shown for both in ways(metric)
    }
    for first, second in comparisons:
        for both in (False, True):
            asked = [metric for metric in shown if both in ways(metric)]
            pairs = pairs_of(panel, first, second, asked, both_succeeded=both)
            for metric in asked:
                tests[metric.column, both].append(_test(pairs, metric, both))
    return tuple(test for family in tests.values() for test in _corrected(family))


def ways(metric: Metric) -> tuple[bool, ...]:
    """Over which worlds a metric is compared: all, or also those in which both succeeded."""
    return (False, True) if metric.needs_arrival else (False,)


def _test(pairs: Pairs, metric: Metric, both: bool) -> PairedTest:
    found = compare(pairs, metric)
    return PairedTest(
        metric=metric,
        first=pairs.first,
        second=pairs.second,
        both_succeeded=both,
        found=found,
        p=found.p,
    )


def _corrected(family: Sequence[PairedTest]) -> list[PairedTest]:
    corrected = holm(np.array([test.found.p for test in family]))
    return [replace(test, p=float(p)) for test, p in zip(family, corrected, strict=True)]


def verdict(test: PairedTest, sign: int) -> Verdict:
    """Whether a difference of this sign was found (`RULE`)."""
    if not test.found.pairs or smallest_p(test.found.units) > ALPHA:
        return Verdict.NOT_TESTABLE
    found = test.p < ALPHA and test.found.mean * sign > 0.0
    return Verdict.REPRODUCED if found else Verdict.NOT_REPRODUCED


def evidence(test: PairedTest) -> str:
    """The numbers of a test as a sentence."""
    found, digits = test.found, test.metric.digits
    if not found.pairs:
        return "no worlds in which both arms succeeded" if test.both_succeeded else "no common worlds"
    shown = "" if test.p < ALPHA else " (none shown)"
    among = ", both succeeded" if test.both_succeeded else ""
    few = "" if smallest_p(found.units) <= ALPHA else f"; p cannot be below {smallest_p(found.units):.2g}"
    return (
        f"{test.metric.label}: {cells.number(found.first_mean, digits)} ({test.first}) against "
        f"{cells.number(found.second_mean, digits)} ({test.second}), difference "
        f"{cells.difference(found, test.metric)}{shown}, p = {cells.p_value(test.p)}, "
        f"{found.pairs} pairs{among}{few}"
    )


def comparisons_table(tests: Sequence[PairedTest], *rules: str) -> Table:
    """The tests as a table, with further notes."""
    return Table(
        name="paired_tests",
        title="Paired comparisons in the same worlds",
        columns=(
            "metric",
            "first",
            "second",
            "pairs",
            "first mean",
            "second mean",
            "first − second [95 %]",
            "p, scenes",
            "p, Holm",
            "p, pairs",
            "effect",
        ),
        rows=tuple(_row(test) for test in tests),
        notes=(
            "p, scenes: sign flips of the scenes' mean differences (of the pairs with fewer than "
            f"{FEWEST_SCENES} scenes), the primary test, exact up to 20; p, Holm: the same, corrected over "
            "the comparisons of one metric; p, pairs: exact McNemar for the success rate, else Wilcoxon's "
            "signed ranks, which take the flights of one scene for independent.",
            "Effect: difference in percentage points for the success rate, else the matched-pairs "
            "rank-biserial correlation (-1 to 1).",
            *rules,
        ),
    )


def _row(test: PairedTest) -> tuple[str, ...]:
    found, digits = test.found, test.metric.digits
    return (
        test.metric.label + (", both succeeded" if test.both_succeeded else ""),
        test.first,
        test.second,
        str(found.pairs),
        cells.number(found.first_mean, digits),
        cells.number(found.second_mean, digits),
        cells.difference(found, test.metric) or cells.NONE,
        cells.p_value(found.p),
        cells.p_value(test.p),
        cells.p_value(found.p_pairs),
        cells.signed(found.effect, 1 if test.metric.is_rate else 2),
    )

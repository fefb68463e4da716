"""Paired tests between arms, corrected for their number."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from uavexp.metrics.metric import Metric
from uavexp.report.comparison import Difference, Pairs, Panel, compare, pairs_of
from uavexp.report.significance import holm


@dataclass(frozen=True, slots=True, kw_only=True)
class PairedTest:
    """One metric compared between two arms."""

    metric: Metric
    first: str
    second: str
    both_succeeded: bool  # only worlds in which both arms succeeded
    found: Difference
    p: float  # of `found`, Holm-corrected over the tests of the same metric

    def __str__(self) -> str:
        found, both = self.found, ", where both succeeded" if self.both_succeeded else ""
        low, high = found.interval
        return (
            f"{self.metric.label}: {self.first} {found.first_mean:.3g}, "
            f"{self.second} {found.second_mean:.3g}, difference {found.mean:.3g} "
            f"(95 %: {low:.3g} to {high:.3g}), p = {self.p:.3g}, {found.pairs} pairs{both}"
        )


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


def paired_test(
    panel: Panel, metric: Metric, first: str, second: str, *, both_succeeded: bool = False
) -> PairedTest:
    """Compare one pair of arms in one metric: nothing to correct for."""
    return _test(
        pairs_of(panel, first, second, [metric], both_succeeded=both_succeeded), metric, both_succeeded
    )


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

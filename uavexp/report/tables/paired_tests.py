"""Every comparison of two arms in the same worlds: the primary arm with each other, and those of claims."""

from __future__ import annotations

from collections.abc import Sequence

from uavexp.metrics.metric import Metric
from uavexp.report import number_format
from uavexp.report.comparison import FEWEST_SCENES
from uavexp.report.judges import RULE
from uavexp.report.paired import PairedTest
from uavexp.report.results import Results
from uavexp.report.tables.base import Table

BOTH_SUCCEEDED = ", both succeeded"  # behind a metric's label
_COLUMNS = (
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
)
_NOTES = (
    "p, scenes: sign flips of the scenes' mean differences (of the pairs with fewer than "
    f"{FEWEST_SCENES} scenes), the primary test, exact up to 20; p, Holm: the same, corrected over "
    "the comparisons of one metric; p, pairs: exact McNemar for the success rate, else Wilcoxon's "
    "signed ranks, which take the flights of one scene for independent.",
    "Effect: difference in percentage points for the success rate, else the matched-pairs "
    "rank-biserial correlation (-1 to 1).",
)


def table(results: Results, *, name: str, metrics: Sequence[Metric]) -> Table | None:
    """The tests of these metrics; none with a single arm."""
    rows = tuple(_row(test) for metric in metrics for test in results.tests if test.metric == metric)
    if not rows:
        return None
    notes = (*_NOTES, RULE) if results.asked else _NOTES
    title = "Paired comparisons in the same worlds"
    return Table(name=name, title=title, columns=_COLUMNS, rows=rows, notes=notes)


def _row(test: PairedTest) -> tuple[str, ...]:
    found, digits = test.found, test.metric.digits
    return (
        test.metric.label + (BOTH_SUCCEEDED if test.both_succeeded else ""),
        test.first,
        test.second,
        str(found.pairs),
        number_format.number(found.first_mean, digits),
        number_format.number(found.second_mean, digits),
        number_format.difference(found, test.metric) or number_format.NONE,
        number_format.p_value(found.p),
        number_format.p_value(test.p),
        number_format.p_value(found.p_pairs),
        number_format.signed(found.effect, 1 if test.metric.is_rate else 2),
    )

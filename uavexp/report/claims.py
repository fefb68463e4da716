"""What Chen et al. 2026 claim of their strategies, and whether it holds here."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from uavexp.report import cells, shown, statistics
from uavexp.report.comparison import Metric, Panel, estimate, interval_of, pairs_of
from uavexp.report.paired import PairedTest, evidence, verdict
from uavexp.report.parts import Claim, Verdict
from uavexp.report.reference import Reference

_SAVED = 0.58  # §4.3.4: "reducing the computational load by approximately 58% compared to TBR"


@dataclass(frozen=True, slots=True)
class _Direction:
    metric: Metric
    words: str  # what the better arm has
    source: str


_DIRECTIONS = (
    _Direction(shown.RATE, "a higher success rate", "abstract, Table 1, §4.3.1"),
    _Direction(shown.PATH, "a shorter path", "Table 1, §4.3.2"),
    _Direction(shown.TIME, "a shorter completion time", "Table 1"),
    _Direction(shown.CONTACTS, "fewer collisions", "Table 1, §4.3.3"),
    _Direction(shown.CLEARANCE, "a larger minimum clearance", "abstract, Table 1, §4.3.3"),
    _Direction(shown.TRACKING, "a smaller tracking error", "Table 1, §4.3.2"),
    _Direction(shown.UNSAFE, "less time below the safe clearance", "figure 8, §4.3.3"),
    _Direction(shown.JERK, "a smoother flight", "abstract, §4.3.2"),
)
_AGAINST_CLOCK = (
    _Direction(shown.REPLANS, "fewer replans", "abstract, Table 1, §4.3.4"),
    _Direction(shown.NEAR_CHANGE, "more of its replans at changes of the map", "§4.3.4, figures 9 and 10"),
)


def claims_of(
    panel: Panel, tests: Sequence[PairedTest], reference: Reference, primary: str, clock: str
) -> tuple[Claim, ...]:
    """Verdicts on the claims of Table 1, the abstract and §4.

    Args:
        panel: all trials.
        tests: of `paired_tests`, the primary arm first.
        reference: the paper's numbers.
        primary: arm that stands for the paper's MCR.
        clock: arm that stands for its TBR; others whose name begins so are asked about, too.
    """
    return (
        *_directions(tests, primary, clock),
        *_consistency(panel, primary, clock),
        *_no_collision(panel, primary),
        *_saved_replans(panel, primary, clock),
        *_sizes(panel, reference, primary),
        *_NOT_TESTABLE,
    )


def _directions(tests: Sequence[PairedTest], primary: str, clock: str) -> Iterator[Claim]:
    for claimed in (*_DIRECTIONS, *_AGAINST_CLOCK):
        for test in tests:
            against_clock = test.second.startswith(clock)
            asked = against_clock or (test.second == "SSP" and claimed in _DIRECTIONS)
            if (
                test.metric is claimed.metric
                and test.both_succeeded == claimed.metric.needs_arrival
                and test.first in (primary, clock)
                and asked
            ):
                yield Claim(
                    statement=f"{test.first} has {claimed.words} than {test.second}",
                    source=claimed.source,
                    verdict=verdict(test, claimed.metric.better),
                    evidence=evidence(test),
                )


def _consistency(panel: Panel, primary: str, clock: str) -> Iterator[Claim]:
    """§4.1: the trends hold in every map configuration."""
    if not {primary, clock} <= set(panel.arms) or len(panel.scenes) < 2:
        return
    pairs = pairs_of(panel, primary, clock, [shown.RATE])
    difference = pairs.columns[shown.RATE.column] @ (1.0, -1.0)
    worse = [
        name for number, name in enumerate(panel.scenes) if np.nansum(difference[pairs.scene == number]) < 0.0
    ]
    yield Claim(
        statement=f"The trends are the same in every scene: {primary} succeeds no less often than {clock}",
        source="§4.1, §4.3",
        verdict=Verdict.NOT_REPRODUCED if worse else Verdict.REPRODUCED,
        evidence=f"less often in {len(worse)} of {len(panel.scenes)} scenes"
        + (f": {', '.join(worse)}" if worse else ""),
    )


def _no_collision(panel: Panel, primary: str) -> Iterator[Claim]:
    if primary not in panel.arms or not panel.has(shown.CONTACTS):
        return
    contacts = panel.values(shown.CONTACTS, primary)
    n, hit = int(np.isfinite(contacts).sum()), int((contacts > 0.0).sum())
    ends = statistics.wilson_interval(hit, n)
    yield Claim(
        statement=f"{primary} incurs no collision",
        source="Table 1, §4.3.3",
        verdict=Verdict.NOT_REPRODUCED if hit else Verdict.REPRODUCED if n else Verdict.NOT_TESTABLE,
        evidence=f"{hit} of {n} flights with a collision, {cells.number(100 * hit / n, 1)} % "
        f"[{cells.number(100 * ends.low, 1)}, {cells.number(100 * ends.high, 1)}]"
        if n
        else "no flight",
    )


def _saved_replans(panel: Panel, primary: str, clock: str) -> Iterator[Claim]:
    """§4.3.4: the share of replans saved, judged by the interval of the ratio of means."""
    for other in (arm for arm in panel.arms if arm.startswith(clock) and primary in panel.arms):
        means = {arm: estimate(panel, shown.REPLANS, arm) for arm in (primary, other)}
        if not means[primary].n or not means[other].mean > 0.0:
            continue
        samples = panel.samples[shown.REPLANS.column]
        ratio = samples[:, panel.arms.index(primary)] / samples[:, panel.arms.index(other)]
        ends = interval_of(100.0 * (1.0 - ratio), statistics.units_of(panel.cluster))
        saved = 100.0 * (1.0 - means[primary].mean / means[other].mean)
        yield Claim(
            statement=f"{primary} replans {100 * _SAVED:g} % less often than {other}",
            source="§4.3.4",
            verdict=_within(100.0 * _SAVED, ends),
            evidence=f"saved: {cells.number(saved, 0)} % {cells.interval(ends, 0)}; reproduced when the "
            "printed share lies in the interval",
        )


def _sizes(panel: Panel, reference: Reference, primary: str) -> Iterator[Claim]:
    """Table 1's numbers themselves; the worlds are not the paper's, so little can be expected."""
    for metric in shown.TABLE_1:
        printed = reference.get((metric.column, primary))
        if printed is None or primary not in panel.arms or not panel.has(metric):
            continue
        found = estimate(panel, metric, primary)
        yield Claim(
            statement=f"{metric.label} of {primary} is {printed.mean:g}",
            source=printed.source,
            verdict=_within(printed.mean, found.interval),
            evidence=f"{cells.mean_with_interval(found, metric, found.n)}; reproduced when the printed mean "
            "lies in the interval",
        )


def _within(printed: float, ends: statistics.Interval) -> Verdict:
    if math.isnan(ends.low):
        return Verdict.NOT_TESTABLE
    return Verdict.REPRODUCED if ends.low <= printed <= ends.high else Verdict.NOT_REPRODUCED


_NOT_TESTABLE = (
    Claim(
        statement="A re-optimisation takes 25 ms on a desktop CPU",
        source="§4.1, §4.5",
        verdict=Verdict.NOT_TESTABLE,
        evidence="another optimiser on another machine: its times are in table wall_times",
    ),
    Claim(
        statement="MCR suits resource-constrained platforms and several UAVs at once",
        source="§4.3.4",
        verdict=Verdict.NOT_TESTABLE,
        evidence="one UAV is flown, on no embedded computer",
    ),
)

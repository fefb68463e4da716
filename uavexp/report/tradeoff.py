"""Success and clearance against replans per mission: what a policy buys with its replans.

The comparison the paper does not show: a policy by the clock is as good or bad as its
interval, so "MCR beats TBR" is asked of every interval.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from uavexp.arrays import Bool, Float
from uavexp.report import cells, shown
from uavexp.report.comparison import Difference, Panel, compare, estimate, pairs_of
from uavexp.report.findings import Findings, arms_table, circumstances, study_panel, values_table
from uavexp.report.parts import Claim, Table, Verdict
from uavexp.report.significance import ALPHA, holm, smallest_p
from uavexp.store.study import Study

METRICS = (
    shown.RATE,
    shown.CONTACTS,
    shown.CLEARANCE,
    shown.REPLANS,
    shown.DETOUR,
    shown.TIME,
    shown.TRACKING,
)
_JUDGED = (shown.RATE, shown.CLEARANCE, shown.REPLANS)


@dataclass(frozen=True, slots=True, kw_only=True)
class Margins:
    """How much less still counts as at least as good (`settings` of the experiment)."""

    success_percent: float = 5.0
    clearance_m: float = 0.02


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
        return max(self.success.p, self.clearance.p, self.replans.p)


def findings(study: Study) -> Findings:
    """Every cell with its place on the front, and "MCR beats TBR" for every interval."""
    panel = study_panel(study, METRICS)
    margins = Margins(**{name: study.settings[name] for name in Margins.__slots__ if name in study.settings})
    return Findings(
        tables=(_table(study, panel),),
        claims=tuple(
            _claims(panel, _own_arms(study, panel), str(study.settings.get("time_based", "TBR")), margins)
        ),
        values=(values_table(panel, METRICS),),
    )


def front(points: Float) -> Bool:
    """Which points no other point is at least as good as in everything and better in something.

    Args:
        points: (N, D), more is better; NaN is never on the front and excludes nobody.
    """
    comparable = np.where(np.isfinite(points), points, -np.inf)
    at_least = np.all(comparable[None] >= comparable[:, None], axis=2)
    better = np.any(comparable[None] > comparable[:, None], axis=2)
    beaten = np.any(at_least & better, axis=1)
    return np.asarray(~beaten & np.all(np.isfinite(points), axis=1))


def _table(study: Study, panel: Panel) -> Table:
    judged = [metric for metric in _JUDGED if panel.has(metric)]
    means = [[metric.better * estimate(panel, metric, arm).mean for metric in judged] for arm in panel.arms]
    marks = front(np.array(means))
    notes = (
        *circumstances(study, panel),
        "Front: by the means, no other arm is at least as good in success, clearance and replans and "
        "better in one of them.",
    )
    title = study.title or "Success and clearance against replans"
    table = arms_table(panel, METRICS, name="tradeoff", title=title, notes=notes)
    rows = tuple((*row, "front" if mark else "") for row, mark in zip(table.rows, marks, strict=True))
    return Table(
        name=table.name, title=table.title, columns=(*table.columns, "front"), rows=rows, notes=table.notes
    )


def _own_arms(study: Study, panel: Panel) -> list[str]:
    """Arms that stand for MCR: the primary policy, at its default setting where one is named."""
    primary, default = str(study.settings.get("primary", "MCR")), study.settings.get("default")
    if default is not None:
        return [arm for arm in panel.arms if arm == f"{primary}, {default}"]
    return [arm for arm in panel.arms if arm == primary or arm.startswith(f"{primary}, ")]


def _claims(panel: Panel, own: Sequence[str], clock: str, margins: Margins) -> Iterator[Claim]:
    if own and all(panel.has(metric) for metric in _JUDGED):
        for other in (arm for arm in panel.arms if arm.startswith(clock) and arm not in own):
            yield _beats([_rival(panel, arm, other, margins) for arm in own], other, margins)


def _rival(panel: Panel, arm: str, other: str, margins: Margins) -> _Rival:
    pairs = pairs_of(panel, arm, other, _JUDGED)
    return _Rival(
        arm=arm,
        success=compare(pairs, shown.RATE, margin=margins.success_percent, alternative="greater"),
        clearance=compare(pairs, shown.CLEARANCE, margin=margins.clearance_m, alternative="greater"),
        replans=compare(pairs, shown.REPLANS, alternative="less"),
    )


def _beats(rivals: Sequence[_Rival], other: str, margins: Margins) -> Claim:
    """Whether some arm of the primary policy is no worse than another and replans less often."""
    paired = [rival for rival in rivals if math.isfinite(rival.p)]
    statement = f"MCR beats {other}: as much success and clearance with fewer replans"
    source = "abstract, §4.3"
    if not paired:
        return Claim(
            statement=statement, source=source, verdict=Verdict.NOT_TESTABLE, evidence="no common worlds"
        )
    corrected = holm(np.array([rival.p for rival in paired]))
    best = int(np.argmin(corrected))
    rival, p = paired[best], float(corrected[best])
    least = len(paired) * smallest_p(rival.success.units, "greater")
    verdict = Verdict.REPRODUCED if p < ALPHA else Verdict.NOT_REPRODUCED
    return Claim(
        statement=statement,
        source=source,
        verdict=Verdict.NOT_TESTABLE if least > ALPHA else verdict,
        evidence=(
            f"nearest: {rival.arm}, success {cells.difference(rival.success, shown.RATE)} points, "
            f"clearance {cells.difference(rival.clearance, shown.CLEARANCE)} m, "
            f"replans {cells.difference(rival.replans, shown.REPLANS)}; p = {cells.p_value(p)} (sign flips "
            f"of scenes for all three, success less by under {margins.success_percent:g} points and "
            f"clearance by under {margins.clearance_m:g} m allowed, Holm over {len(paired)} arms)"
        ),
    )

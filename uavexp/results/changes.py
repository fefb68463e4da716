"""What a study flown anew says otherwise than the one committed, by how much, and whether by chance."""

from __future__ import annotations

import csv
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pandas as pd
from scipy import stats

from uavexp.arrays import Float
from uavexp.metrics.metric import Metric
from uavexp.report import number_format
from uavexp.report.comparison import compare, pairs_of, panel_of
from uavexp.report.labels import metrics_of
from uavexp.report.results import ARM, Results
from uavexp.report.significance import holm
from uavexp.store.study import read_study
from uavexp.store.table import TABLE

CLAIMS = "claims.csv"


@dataclass(frozen=True, slots=True, kw_only=True)
class Change:
    """The mean of one metric of one arm, before and now: of these flights, not of other scenes like them."""

    arm: str
    metric: Metric
    before: float  # of the pairs; unpaired, of all flights
    now: float
    pairs: int  # of the same scene and seed; 0: compared unpaired
    p: float  # of the flights (McNemar, Wilcoxon; unpaired: Mann and Whitney), Holm over the study

    def __str__(self) -> str:
        before, now = (number_format.number(value, self.metric.digits) for value in (self.before, self.now))
        of = f"{self.pairs} pairs" if self.pairs else "unpaired"
        return f"{self.arm}: {self.metric.label} {before} -> {now}, p = {number_format.p_value(self.p)}, {of}"


def changes(committed: Path, flown: Path) -> list[Change]:
    """Every arm and every metric of the committed tables that both hold, where it can be tested.

    Raises:
        RecordError: one of the folders holds no study, or a damaged one.
    """
    both = Results(study=read_study(committed)), Results(study=read_study(flown))
    found = [change for change in _changes(*both, _shown(committed)) if math.isfinite(change.p)]
    corrected = holm(np.array([change.p for change in found]))
    return [replace(change, p=float(p)) for change, p in zip(found, corrected, strict=True)]


def _changes(before: Results, now: Results, shown: Sequence[str]) -> Iterator[Change]:
    for metric in metrics_of(shown):
        if metric.better and all(metric.column in results.trials for results in (before, now)):
            for arm in before.arms:
                if arm in now.arms:
                    yield _change(before.trials, now.trials, arm, metric)


def _shown(committed: Path) -> list[str]:
    """Metrics of the committed tables, but for clock times, which are the machine's."""
    rows = _rows(committed / "tables" / "values.csv")
    return [name for name in dict.fromkeys(row["metric"] for row in rows) if not name.startswith("wall_")]


def _change(before: pd.DataFrame, now: pd.DataFrame, arm: str, metric: Metric) -> Change:
    both = [
        trials[trials[ARM] == arm].assign(**{ARM: name})
        for name, trials in zip("ab", (before, now), strict=True)
    ]
    panel = panel_of(pd.concat(both, ignore_index=True), ARM, ("a", "b"))
    found = compare(pairs_of(panel, "a", "b", [metric]), metric)
    one, two = (_there(panel.values(metric, name)) for name in "ab")
    unpaired = [float(some.mean()) if some.size else math.nan for some in (one, two)]
    before, after = (found.first_mean, found.second_mean) if found.pairs else unpaired
    p = found.p_pairs if found.pairs else _unpaired_p(one, two)
    return Change(arm=arm, metric=metric, before=before, now=after, pairs=found.pairs, p=p)


def _there(values: Float) -> Float:
    return values[np.isfinite(values)]


def _unpaired_p(one: Float, two: Float) -> float:
    """Mann and Whitney's test, two-sided; NaN where there is nothing to compare."""
    return float(stats.mannwhitneyu(one, two).pvalue) if one.size and two.size else math.nan


def is_the_same(committed: Path, flown: Path) -> bool:
    """Whether two folders hold the same trials of the same code; not when one of them is not there."""
    files = [place / TABLE for place in (committed, flown)]
    if not all(file.is_file() for file in files):
        return False
    one, two = (
        set(pd.read_parquet(file, columns=["trial", "code"]).itertuples(index=False)) for file in files
    )
    return one == two


def verdict_changes(committed: Path, flown: Path) -> list[str]:
    """Claims whose verdict is another one now, in words."""
    before, now = ({row["claim"]: row["verdict"] for row in _rows(it / CLAIMS)} for it in (committed, flown))
    return [
        f"{claim}: {before.get(claim, 'not judged')} -> {now.get(claim, 'not judged')}"
        for claim in dict.fromkeys([*before, *now])
        if before.get(claim) != now.get(claim)
    ]


def _rows(file: Path) -> list[dict[str, str]]:
    if not file.is_file():
        return []
    with file.open(encoding="utf-8", newline="") as text:
        return list(csv.DictReader(text))

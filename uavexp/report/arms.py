"""Arms against each other in the metrics that the experiment names, the paper's numbers beside.

The experiment's file says what is shown and claimed:

    settings:
      primary: DF-BIT*                      compared with each of the others
      metrics: [success, plan_length_m]     columns of trials.parquet, in the order shown
      claims:                               the paper's, judged by the paired tests
        - {says: "...", source: "Table 1", metric: plan_length_m, first: DF-BIT*, second: RRT*}
"""

from __future__ import annotations

import csv
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from uavexp.errors import RecordError
from uavexp.paths import experiments_folder
from uavexp.report import cells, shown
from uavexp.report.comparison import Metric, Panel, estimate
from uavexp.report.findings import FAILED, INTERVALS, Findings, circumstances, study_panel, values_table
from uavexp.report.paired import RULE, PairedTest, comparisons_table, evidence, paired_tests, verdict
from uavexp.report.parts import Claim, Table, Verdict
from uavexp.report.reference import Reference, read_reference
from uavexp.store.study import Study

CONTRADICTIONS = "contradictions.csv"
_COLUMNS = ("printed", "check", "so")
_CLAIM_KEYS = {"says", "source", "metric", "first", "second"}


def findings(study: Study) -> Findings:
    """How each arm did, each against the primary one, the paper's claims and contradictions.

    Raises:
        RecordError: the settings name a metric or claim that cannot be read.
    """
    metrics = metrics_of(study)
    panel = study_panel(study, metrics)
    reference = read_reference(study.name)
    primary = str(study.settings.get("primary", panel.arms[0]))
    others = [(primary, arm) for arm in panel.arms if arm != primary] if primary in panel.arms else []
    asked = [(claim["first"], claim["second"]) for claim in _claims(study) if "second" in claim]
    asked = [pair for pair in asked if set(pair) <= set(panel.arms)]  # a part of the arms may be flown
    tests = paired_tests(panel, metrics, list(dict.fromkeys([*others, *asked])))
    return Findings(
        tables=(
            _arms(study, panel, metrics, reference),
            *((comparisons_table(tests, RULE),) if tests else ()),
            *_contradictions(study),
        ),
        claims=tuple(_judged(study, tests)),
        rule=RULE,
        values=(values_table(panel, metrics),),
    )


def metrics_of(study: Study) -> tuple[Metric, ...]:
    """The metrics that a study shows, in its order.

    Raises:
        RecordError: one is unknown.
    """
    wanted = [str(name) for name in study.settings.get("metrics", [])]
    wanted = wanted or [metric.column for metric in shown.TABLE_1]
    unknown = [name for name in wanted if name not in shown.BY_COLUMN]
    if unknown:
        raise RecordError(
            f"settings.metrics: {', '.join(unknown)} unknown; known are {', '.join(sorted(shown.BY_COLUMN))}"
        )
    return tuple(shown.BY_COLUMN[name] for name in wanted)


def _arms(study: Study, panel: Panel, metrics: Sequence[Metric], reference: Reference) -> Table:
    """A row per metric, a column per arm: mean ± SD [interval], the paper's beside."""

    def cell(metric: Metric, arm: str) -> str:
        found = cells.mean_with_spread(estimate(panel, metric, arm), metric, panel.n(arm))
        printed = reference.get((metric.column, arm))
        return f"{found} (paper: {printed.mean:g})" if printed else found

    flown = ("Trials, n", *(str(panel.n(arm)) for arm in panel.arms))
    rows = [
        (metric.label, *(cell(metric, arm) for arm in panel.arms)) for metric in metrics if panel.has(metric)
    ]
    return Table(
        name="arms",
        title=study.title or "How each arm did",
        columns=("", *panel.arms),
        rows=(flown, *rows),
        notes=(
            *circumstances(study, panel),
            *map(str, study.settings.get("notes", ())),
            "Mean ± standard deviation over trials; of the success rate over the scenes' rates.",
            INTERVALS,
            FAILED,
        ),
    )


def _claims(study: Study) -> list[Mapping[str, Any]]:
    claims = study.settings.get("claims", [])
    for claim in claims:
        if not isinstance(claim, Mapping) or not {"says", "source"} <= set(claim) <= _CLAIM_KEYS | {"why"}:
            raise RecordError(
                f"settings.claims: each needs {', '.join(sorted(_CLAIM_KEYS))} "
                f"(or says, source and why it cannot be tested), got {claim}"
            )
    return list(claims)


def _judged(study: Study, tests: Sequence[PairedTest]) -> Iterator[Claim]:
    for claim in _claims(study):
        test = _test_of(claim, tests)
        sign = test.metric.better if test else 0
        yield Claim(
            statement=str(claim["says"]),
            source=str(claim["source"]),
            verdict=verdict(test, sign) if test else Verdict.NOT_TESTABLE,
            evidence=evidence(test) if test else str(claim.get("why", "the trials do not have it")),
        )


def _test_of(claim: Mapping[str, Any], tests: Sequence[PairedTest]) -> PairedTest | None:
    """The test of a claim: among worlds in which both succeeded, where the metric needs arrival."""
    asked = [claim.get(key) for key in ("metric", "first", "second")]
    for test in tests:
        same = [test.metric.column, test.first, test.second] == asked
        if same and test.both_succeeded == test.metric.needs_arrival:
            return test
    return None


def _contradictions(study: Study) -> Iterator[Table]:
    """Where the paper contradicts itself: `experiments/PAPER/contradictions.csv`."""
    paper = study.name.rpartition("/")[0]
    file = experiments_folder() / paper / CONTRADICTIONS
    if paper and file.is_file():
        yield Table(
            name="contradictions",
            title="Contradictions in the paper",
            columns=_COLUMNS,
            rows=tuple(_rows(file)),
        )


def _rows(file: Path) -> Iterator[tuple[str, ...]]:
    try:
        with file.open(encoding="utf-8", newline="") as text:
            for row in csv.DictReader(text):
                yield tuple(row[name] for name in _COLUMNS)
    except (KeyError, ValueError) as error:
        raise RecordError(f"{file}: damaged ({error})") from error

"""Claims of one sentence are corrected together; failed flights have no lengths, times, tracking."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from tests.unit.report.test_report_tables import report_of, trials_of
from uavexp.metrics.evaluate import metric_of
from uavexp.report.comparison import estimate
from uavexp.report.judges import Verdict
from uavexp.report.number_format import NONE

METRICS = ("success", "collision_count", "min_clearance_m", "replans")


def claims(sentence: str = "") -> dict[str, object]:
    said = {"says": "{first} is better than {second}", "source": "here", "arms": ["MCR", "TBR"]}
    return {
        "tables": ["paired_tests"],
        "claims": [
            {**said, "metric": name, **({"sentence": sentence} if sentence else {})} for name in METRICS
        ],
    }


@pytest.fixture(scope="module")
def trials() -> pd.DataFrame:
    from tests.unit.report.test_report_tables import BAD, GOOD

    return trials_of({"TBR": BAD, "MCR": GOOD})


def test_p_of_a_sentence_is_holms_over_its_claims(trials: pd.DataFrame) -> None:
    report = report_of(trials, claims("safer"))
    tests = [test for test in report.results.tests if test.metric.column in METRICS]
    p = np.array(sorted(test.found.p for test in tests))
    found = sorted(report.results.borne(test)[0] for test in tests)
    assert np.allclose(found, np.minimum(np.maximum.accumulate(p * (p.size - np.arange(p.size))), 1.0))
    assert p.size == len(METRICS)
    assert {report.results.borne(test)[1] for test in tests} == {len(METRICS)}


def test_a_claim_that_holds_alone_need_not_hold_among_many(trials: pd.DataFrame) -> None:
    """Six scenes: the least p is 2 / 2^6 = 0.03, twice that is above 0.05."""
    few = trials[trials["scene"].isin(sorted(trials["scene"].unique())[:6])]
    alone, together = (report_of(few, claims(sentence)).judgements for sentence in ("", "safer"))
    assert Verdict.REPRODUCED in [one.verdict for one in alone]
    assert Verdict.REPRODUCED not in [one.verdict for one in together]
    assert all("Holm over the 4 claims" in one.evidence for one in together)


@pytest.mark.parametrize(("failed", "is_told"), [(0.4, True), (0.5, True), (0.6, False)])
def test_what_needs_arrival_is_a_dash_where_most_flights_failed(
    trials: pd.DataFrame, failed: float, is_told: bool
) -> None:
    mine = trials.copy()
    rows = mine.index[mine["arm"] == "TBR"]
    mine.loc[rows, "success"] = np.arange(rows.size) >= failed * rows.size
    report = report_of(
        mine, {"tables": [{"by_arm": {"metrics": ["success", "tracking_error_m", "replans"]}}]}
    )
    panel = report.results.panel
    for column in ("tracking_error_m", "path_length_m"):
        assert np.isfinite(estimate(panel, metric_of(column), "TBR").mean) == is_told
    assert np.isfinite(estimate(panel, metric_of("replans"), "TBR").mean)
    row = next(row for row in report.tables[0].rows if row[0] == "TBR")
    assert (row[3] == NONE) != is_told
    assert "dashes" in " ".join(report.tables[0].notes)

"""The report of arms in named metrics, on trials made up so that every answer is known."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from tests.studies import made_up
from uavexp.report.contents import Report
from uavexp.report.judges import Verdict
from uavexp.report.make import make_report
from uavexp.store.study import Study

ARMS, SCENES, SEEDS = ("new", "old"), tuple(f"scene {n}" for n in range(8)), range(4)
CLAIMS = [
    {
        "says": "new is shorter",
        "source": "Table 1",
        "metric": "plan_length_m",
        "arms": ["new", "old"],
    },
    {
        "says": "new breaks fewer",
        "source": "T 1",
        "metric": "limit_violations",
        "arms": ["new", "old"],
    },
    {"says": "it fits a small computer", "source": "§5", "why": "no small computer here"},
]


def trials() -> pd.DataFrame:
    """The new arm's plan is 1 m shorter in every world; neither breaks a limit."""
    rng = np.random.default_rng(3)
    rows: list[dict[str, Any]] = []
    for scene in SCENES:
        for seed in SEEDS:
            length = 20.0 + 5.0 * rng.random()
            for arm in ARMS:
                own = length - (arm == "new")
                cost = {f"plan_cost_at_{10**k}": own * (1.0 + 1.0 / k) for k in (1, 2, 3)}
                row = {"arm": arm, "scene": scene, "seed": seed, "success": True, "status": "ok"}
                row |= {"plan_length_m": own, "limit_violations": 0.0, "trial": f"{arm}-{scene}-{seed}"}
                rows.append(row | cost | {"plan_iterations": 1000.0, "wall_search_sum_s": 0.5})
    return pd.DataFrame(rows)


def study_of(folder: Path, **changes: Any) -> Study:
    settings = {"primary": "new", "metrics": ["success", "plan_length_m", "limit_violations"]}
    report = {"tables": [{"by_metric": {"name": "arms"}}, "paired_tests"], "claims": CLAIMS}
    figures = [{"metric_panels": {"name": "arms"}}, "convergence", "first_plans"]
    axes = {"arm": ARMS, "scene": SCENES}
    return made_up(folder, trials(), axes, report={**report, "figures": figures} | changes, settings=settings)


def test_claims_are_judged_by_the_paired_test_of_their_metric(tmp_path: Path) -> None:
    found = Report(study=study_of(tmp_path / "study"))
    assert [claim.verdict for claim in found.judgements] == [
        Verdict.REPRODUCED,  # shorter in all of 8 scenes: p = 2 / 2**8
        Verdict.NOT_SHOWN,  # none breaks any
        Verdict.NOT_TESTABLE,
    ]
    assert "-1.00" in found.judgements[0].evidence
    assert found.judgements[2].evidence == "no small computer here"


def test_the_table_has_the_metrics_asked_for_in_their_order(tmp_path: Path) -> None:
    table = Report(study=study_of(tmp_path / "study")).tables[0]
    assert table.columns == ("", "new", "old")
    assert [row[0].split(",")[0].split(" [")[0] for row in table.rows] == [
        "Trials",
        "Success rate",
        "Length of the plan",
        "Limit violations of the plan",
    ]
    assert table.rows[0][1:] == ("32", "32")


def test_cost_falls_over_iterations_and_over_time(tmp_path: Path) -> None:
    drawings = {drawing.name: drawing for drawing in Report(study=study_of(tmp_path / "study")).drawings()}
    assert set(drawings) == {"arms", "convergence"}
    by_iteration, by_time = drawings["convergence"].figure.axes[:2]
    curve, timed = by_iteration.lines[0], by_time.lines[0]
    assert list(curve.get_xdata()) == [10.0, 100.0, 1000.0]
    assert np.all(np.diff(curve.get_ydata()) < 0.0)
    assert curve.get_ydata()[-1] == pytest.approx(1.0)  # the new arm finds the best in every world
    assert list(timed.get_xdata()) == [5.0, 50.0, 500.0]  # 0.5 ms an iteration


def test_a_claim_about_an_arm_that_was_not_flown_is_not_testable(tmp_path: Path) -> None:
    part = made_up(
        tmp_path / "study",
        trials().query("arm == 'old'"),
        {"arm": ("old",), "scene": SCENES},
        report={"claims": CLAIMS},
        settings={"primary": "new", "metrics": ["plan_length_m"]},
    )
    assert {claim.verdict for claim in Report(study=part).judgements} == {Verdict.NOT_TESTABLE}


def test_the_whole_report_is_written(tmp_path: Path) -> None:
    files = {path.name for path in make_report(study_of(tmp_path / "study").folder)}
    assert {"arms.md", "paired_tests.tex", "claims.md", "convergence.pdf", "report.html"} <= files

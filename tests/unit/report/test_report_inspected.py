"""The figures of inspections, on two made-up flights whose coverage is known at every instant."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from tests.logs import make_log, make_world, still_curve
from tests.studies import made_up
from uavexp.log import TrialLog
from uavexp.report.contents import Report
from uavexp.store.logs import log_arrays, pack
from uavexp.store.records import LOG
from uavexp.store.study import TRIALS, WORLDS, Study
from uavexp.store.worlds import world_bytes

ARMS = ("static", "both")
CELLS = 40


def flight(share: float) -> TrialLog:
    """One cell a twentieth of a second is seen, up to this share."""
    seen_s = np.where(np.arange(CELLS) < share * CELLS, 0.05 * np.arange(CELLS), np.inf)
    return make_log(
        still_curve(),
        still_curve(),
        cell_m=np.random.default_rng(0).random((CELLS, 3)).astype(np.float32),
        cell_seen_s=seen_s,
        cell_visible=np.ones(CELLS, dtype=np.bool_),
        viewpoint_m=np.array([[1.0, 1.0, 1.0], [2.0, 1.0, 1.0]]),
        viewpoint_yaw_rad=np.zeros(2),
        viewpoint_segment=np.zeros(2, dtype=np.int64),
        viewpoint_visited_s=np.array([0.5, np.inf]),
    )


def study_of(folder: Path, kinds: tuple[str, str] = ARMS) -> Study:
    rows = [
        {
            "scene_kind": kind,
            "arm": arm,
            "seed": 3,
            "success": True,
            "status": "ok",
            "coverage_visible": share,
            "trial": f"{arm}-3",
            "world_digest": "w",
        }
        for arm, kind, share in zip(ARMS, kinds, (1.0, 0.5), strict=True)
    ]
    figures = [
        {"metric_panels": {"name": "arms"}},
        {"inspected_plans": {"name": "plans"}},
        "coverage_over_time",
    ]
    report = {"figures": figures}
    settings = {"primary": "static", "metrics": ["coverage_visible"]}
    study = made_up(folder, pd.DataFrame(rows), {"arm": ARMS}, report=report, settings=settings)
    (folder / WORLDS).mkdir()
    (folder / WORLDS / "w.npz").write_bytes(world_bytes(make_world([([3.0, 3.0, 0.0], [4.0, 4.0, 2.0])])))
    for arm, share in zip(ARMS, (1.0, 0.5), strict=True):
        (folder / TRIALS / f"{arm}-3").mkdir(parents=True)
        (folder / TRIALS / f"{arm}-3" / LOG).write_bytes(pack(log_arrays(flight(share))))
    return study


def test_coverage_rises_to_each_arms_share(tmp_path: Path) -> None:
    drawings = {drawing.name: drawing for drawing in Report(study=study_of(tmp_path / "study")).drawings()}
    assert set(drawings) == {"arms", "plans", "coverage_over_time"}
    curves = drawings["coverage_over_time"].figure.axes[0].lines
    assert [curve.get_label() for curve in curves] == ["static (1)", "both (1)"]
    for curve, share in zip(curves, (100.0, 50.0), strict=True):
        seen = np.asarray(curve.get_ydata())
        assert (np.diff(seen) >= 0.0).all()
        assert seen[0] == pytest.approx(100.0 / CELLS)
        assert seen[-1] == pytest.approx(share)


def test_the_plans_are_of_the_first_and_the_last_arm(tmp_path: Path) -> None:
    drawings = {drawing.name: drawing for drawing in Report(study=study_of(tmp_path / "study")).drawings()}
    titles = [axes.get_title() for axes in drawings["plans"].figure.axes]
    assert [title.split(":")[0] for title in titles] == ["static, seed 3", "both, seed 3"]
    assert ["100.00 %" in titles[0], "50.00 %" in titles[1]] == [True, True]


def test_a_study_without_inspections_has_neither(tmp_path: Path) -> None:
    names = {drawing.name for drawing in Report(study=study_of(tmp_path / "study", ("", ""))).drawings()}
    assert names == {"arms"}

"""Figures of a report: the numbers of the trials, chosen by the rule they state, at a paper's size."""

from __future__ import annotations

import shutil

import matplotlib as mpl
import numpy as np
import pandas as pd
import pytest
from matplotlib.text import Text

from tests.studies import copy_of, made_up, shipped
from uavexp.causes import cause_named
from uavexp.metrics import replanning
from uavexp.metrics.replanning import COUNTED, cause_metric
from uavexp.report import flights as shown_flights
from uavexp.report import style
from uavexp.report.contents import Report
from uavexp.report.derived import FALSE_TRIGGERS
from uavexp.report.figures import base
from uavexp.report.figures.base import png_of
from uavexp.report.figures.minimum_clearance import crowding
from uavexp.report.figures.trade_off import curves_of
from uavexp.report.results import ARM, Results
from uavexp.store.study import LOG, TRIALS, WORLDS

WITH_LOGS = {"figure_3", "figure_4", "figure_5", "figure_8"}
TEXT_PT = 7.0  # the least that is read in print


@pytest.fixture(scope="module")
def drawings(flown):
    return {drawing.name: drawing for drawing in Report(study=flown).drawings()}


def rows_of(arms, scenes, seeds, **columns):
    index = pd.MultiIndex.from_product([arms, scenes, range(seeds)], names=["arm", "scene", "seed"])
    table = index.to_frame(index=False)
    trial = [f"t{number}" for number in range(len(table))]
    fixed = {"strategy": "x", "world": "w", "outcome": "reached", "status": "ok", "trial": trial}
    return table.assign(**fixed, trigger=table["arm"], **columns)


class TestWhatIsDrawn:
    def test_a_study_with_logs_gets_the_papers_figures(self, drawings):
        assert {*WITH_LOGS, "figure_6", "figure_7", "figure_9", "success"} <= set(drawings)

    def test_without_logs_the_figures_of_single_flights_are_left_out(self, flown, tmp_path):
        study = copy_of(flown, tmp_path / "bare")
        shutil.rmtree(study.folder / TRIALS)
        names = {drawing.name for drawing in Report(study=study).drawings()}
        assert names >= {"figure_6", "figure_7", "figure_9", "success"}
        assert not names & {*WITH_LOGS, "figure_10"}

    def test_without_worlds_too(self, flown, tmp_path):
        study = copy_of(flown, tmp_path / "bare")
        shutil.rmtree(study.folder / WORLDS)
        assert not {drawing.name for drawing in Report(study=study).drawings()} & {*WITH_LOGS, "figure_10"}

    def test_every_caption_tells_n_and_seeds(self, drawings):
        for drawing in drawings.values():
            assert "seed" in drawing.caption, drawing.name
            assert "n = " in drawing.caption or "trials" in drawing.caption, drawing.name

    def test_the_same_study_gives_the_same_bytes_and_leaves_the_users_style_alone(self, flown):
        with mpl.rc_context({"font.size": 23.0}):
            again = {drawing.name: drawing for drawing in Report(study=flown).drawings()}
            assert mpl.rcParams["font.size"] == 23.0
        with style.house_style():
            once = {drawing.name: png_of(drawing.figure) for drawing in Report(study=flown).drawings()}
            for name, drawing in again.items():
                assert png_of(drawing.figure) == once[name], name

    def test_text_is_legible_in_print_and_the_width_a_papers(self, drawings):
        for name, drawing in drawings.items():
            assert drawing.figure.get_figwidth() in (base.COLUMN_IN, base.PAGE_IN), name
            for text in drawing.figure.findobj(Text):
                assert not text.get_text() or text.get_fontsize() >= TEXT_PT, (name, text.get_text())


class TestWhichFlights:
    def test_the_world_shown_is_the_lowest_seed_flown_by_every_arm(self, flown, tmp_path):
        study = copy_of(flown, tmp_path / "holes")
        flights, arms = Results(study=study).trials, shown_flights.three_arms(Results(study=study))

        def first():
            results = Results(study=study)
            return next(shown_flights.shared_worlds(results, arms, results.scenes[:1]))

        seeds = sorted(flights["seed"].unique())
        assert first().seed == seeds[0]
        assert tuple(first().logs) == arms
        gone = flights[(flights["seed"] == seeds[0]) & (flights[ARM] == arms[-1])]
        for trial in gone["trial"]:
            (study.folder / TRIALS / trial / LOG).unlink()
        assert first().seed == seeds[1]

    def test_the_three_strategies_are_the_papers_whatever_else_was_flown(self, tmp_path):
        arms = ("other", "MCR", "SSP", "TBR frequent", "TBR")
        rows, axes = rows_of(arms, ("a",), 1, success=True), {"arm": arms, "scene": ("a",)}
        study = made_up(tmp_path, rows, axes, settings={"primary": "MCR"})
        assert shown_flights.three_arms(Results(study=study)) == ("SSP", "TBR", "MCR")

    def test_replans_of_the_table_are_those_of_the_logs(self, flown):
        flights = Results(study=flown).trials
        counted = shown_flights.executed(flown.replans, flights)["trial"].value_counts()
        for row in flights.to_dict("records"):
            log = replanning.executed(flown.log(row["trial"]))
            assert counted.get(row["trial"], 0) == len(log) == row["replans"]


class TestPaths:
    def test_figure_3_draws_the_flown_paths_to_scale(self, flown, drawings):
        results = Results(study=flown)
        arms = shown_flights.three_arms(results)
        shared = next(shown_flights.shared_worlds(results, arms, results.scenes[:1]))
        axes = drawings["figure_3"].figure.axes[0]
        drawn = [line.get_xydata() for line in axes.lines if len(line.get_xydata()) > 100]
        for log in shared.logs.values():
            ends = [line for line in drawn if np.allclose(line[0], log.steps.position_m[0, :2])]
            assert any(np.linalg.norm(line[-1] - log.steps.position_m[-1, :2]) < 0.1 for line in ends)
        assert axes.get_aspect() == 1.0

    def test_figure_9_has_a_marker_for_every_replan_of_the_scene(self, flown, drawings):
        flights, scene = Results(study=flown).trials, Results(study=flown).scenes[0]
        expected = shown_flights.executed(flown.replans, flights[flights["scene"] == scene])
        causes = {cause_named(cause).colour for cause in expected["cause"]}
        lines = [line for axes in drawings["figure_9"].figure.axes for line in axes.lines]
        drawn = sum(
            len(line.get_xdata())
            for line in lines
            if line.get_color() in causes and line.get_marker() not in ("x", "|")
        )
        assert drawn == len(expected) > 0
        longest_s = flights[flights["scene"] == scene]["completion_time_s"][flights["arm"] != "SSP"].max()
        assert all(axes.get_xlim()[1] >= longest_s for axes in drawings["figure_9"].figure.axes)

    def test_figure_9_has_room_for_causes_of_any_name_and_leaves_first_plans_out(self, tmp_path):
        table = rows_of(("MCR",), ("a",), 2, success=True, completion_time_s=9.0, min_clearance_m=0.4)
        table["collision_count"] = 0
        event = {"effective_s": 3.0, "time_s": 2.9, "status": "ok", "path_change_m": 0.1, "near_change": True}
        causes = ("first", "retry", "map")
        replans = [
            {"trial": trial, "number": number, "cause": cause, **event}
            for trial in table["trial"]
            for number, cause in enumerate(causes)
        ]
        late = {"trial": "t0", "number": 3, "cause": "goal", **event, "effective_s": 9.5}  # after the end
        axes = {"arm": ("MCR",), "scene": ("a",)}
        study = made_up(
            tmp_path, table, axes, report=shipped("mcr/table1"), replans=pd.DataFrame([*replans, late])
        )
        drawing = next(drawing for drawing in Report(study=study).drawings() if drawing.name == "figure_9")
        (legend,) = drawing.figure.legends
        words = [text.get_text() for text in legend.get_texts()]
        assert words == ["map", "retry", "end: success", "end: failure"]
        assert "2.0 replans a flight" in drawing.figure.axes[0].get_title(loc="left")


class TestSafety:
    def study(self, tmp_path, clearance_m, contacts):
        n = len(clearance_m)
        table = rows_of(
            ("MCR",), ("a",), n, success=True, min_clearance_m=clearance_m, collision_count=contacts
        )
        return made_up(tmp_path, table, {"arm": ("MCR",), "scene": ("a",)}, report=shipped("mcr/table1"))

    def drawing(self, study, name):
        return next(drawing for drawing in Report(study=study).drawings() if drawing.name == name)

    def test_every_flight_is_a_point_at_its_clearance(self, tmp_path):
        clearance_m = np.random.default_rng(0).gamma(9.0, 0.05, 200)
        axes = self.drawing(self.study(tmp_path, clearance_m, 0), "figure_7").figure.axes[0]
        cloud = max((line.get_xydata() for line in axes.lines), key=len)
        np.testing.assert_allclose(np.sort(cloud[:, 1]), np.sort(clearance_m))
        assert len(np.unique(cloud.round(9), axis=0)) == 200  # none hides another

    def test_too_many_flights_are_thinned_evenly_and_the_caption_says_so(self, tmp_path):
        clearance_m = np.random.default_rng(0).gamma(9.0, 0.05, 3000)
        drawing = self.drawing(self.study(tmp_path, clearance_m, 0), "figure_7")
        cloud = max((line.get_ydata() for line in drawing.figure.axes[0].lines), key=len)
        assert len(cloud) == 400
        assert "400 flights of each arm are drawn" in drawing.caption
        np.testing.assert_allclose(
            np.quantile(cloud, [0, 0.5, 1]), np.quantile(clearance_m, [0, 0.5, 1]), rtol=0.01
        )

    def test_the_shares_of_contacts_are_counted(self, tmp_path):
        contacts = [0, 0, 0, 1, 1, 2, 5, 9]
        drawing = self.drawing(self.study(tmp_path, np.full(8, 0.3), contacts), "figure_6")
        widths = [bar.get_width() for bar in drawing.figure.axes[0].patches]
        np.testing.assert_allclose(widths, [37.5, 25.0, 12.5, 0.0, 25.0])  # 0, 1, 2, 3, 4 or more

    @pytest.mark.parametrize("values", [[], [0.3], [0.3, 0.3, 0.3], [0.1, 0.2]])
    def test_a_cloud_of_any_size_stays_in_its_column(self, values):
        places = crowding(np.array(values))
        assert places.shape == (len(values),)
        assert np.all(np.abs(places) <= 1.0)


class TestTradeoff:
    def study(self, tmp_path):
        axes = {
            "policy": ("TBR", "MCR"),
            "setting": ("interval_s=1", "interval_s=2", ""),
            "scene": ("a", "b"),
        }
        parts = []
        for policy, setting, interval_s, replans in (
            ("TBR", "interval_s=1", 1.0, 12.0),
            ("TBR", "interval_s=2", 2.0, 7.0),
            ("MCR", "", None, 5.0),
        ):
            part = rows_of((policy,), ("a", "b"), 4, success=True, min_clearance_m=0.1 * replans)
            part = part.rename(columns={"arm": "policy"})
            parts.append(part.assign(setting=setting, p_trigger_interval_s=interval_s, replans=replans))
        table = pd.concat(parts, ignore_index=True)
        table["trial"] = [f"t{number}" for number in range(len(table))]
        return made_up(tmp_path, table, axes, report=shipped("mcr/thresholds"))

    def test_a_curve_per_policy_joined_along_its_parameter(self, tmp_path):
        study = self.study(tmp_path)
        curves = curves_of(Results(study=study))
        assert [(curve.name, curve.labels, curve.parameter) for curve in curves] == [
            ("TBR", ("1", "2"), "interval_s"),
            ("MCR", ("",), ""),
        ]

    def test_points_stand_at_the_means(self, tmp_path):
        drawing = next(iter(Report(study=self.study(tmp_path)).drawings()))
        left, right = drawing.figure.axes
        by_name = {line.get_label(): line for line in right.lines}
        np.testing.assert_allclose(by_name["TBR"].get_xydata(), [[12.0, 1.2], [7.0, 0.7]])
        np.testing.assert_allclose(by_name["MCR"].get_xydata(), [[5.0, 0.5]])
        assert {tuple(line.get_ydata()) for line in left.lines} == {(100.0, 100.0), (100.0,)}
        assert "TBR: interval_s" in drawing.caption

    def test_without_settings_presets_that_differ_in_many_parameters_are_not_joined(self, tmp_path):
        arms = ("MCR", "MCR literal")
        table = rows_of(arms, ("a", "b"), 2, success=True, min_clearance_m=0.4, replans=3.0)
        table["trigger"] = "mcr"
        table["p_trigger_judge"] = np.where(table["arm"] == "MCR", "path", "region")
        table["p_trigger_since"] = np.where(table["arm"] == "MCR", "plan", "update")
        study = made_up(tmp_path, table, {"arm": arms, "scene": ("a", "b")}, report=shipped("mcr/thresholds"))
        curves = curves_of(Results(study=study))
        assert [curve.arms for curve in curves] == [("MCR",), ("MCR literal",)]

    @pytest.mark.parametrize("failed", [("SSP",), ("SSP", "MCR")])
    def test_an_arm_of_which_nothing_is_known_leaves_the_others_in_view(self, tmp_path, failed):
        arms = ("SSP", "MCR")
        table = rows_of(arms, ("a", "b"), 2, success=True, min_clearance_m=0.4, replans=3.0)
        table.loc[table["arm"].isin(failed), ["min_clearance_m", "replans"]] = np.nan
        study = made_up(tmp_path, table, {"arm": arms, "scene": ("a", "b")}, report=shipped("mcr/thresholds"))
        for drawing in Report(study=study).drawings():
            assert all(np.isfinite(axes.get_xlim()).all() for axes in drawing.figure.axes)


def test_policies_show_the_shares_of_causes_and_of_useful_replans(tmp_path):
    arms = ("MCR", "TBR")
    table = rows_of(arms, ("a", "b"), 3, success=True, min_clearance_m=0.4)
    ours = table["arm"] == "MCR"
    table = table.assign(
        replans=np.where(ours, 8.0, 10.0),
        replans_map=np.where(ours, 2.0, 0.0),
        replans_goal=np.where(ours, 6.0, 0.0),
        replans_clock=np.where(ours, 0.0, 10.0),
        useful_replans=np.where(ours, 6.0, 4.0),
        blocked_delay_s=np.where(ours, 0.1, np.nan),
    )
    study = made_up(tmp_path, table, {"arm": arms, "scene": ("a", "b")}, report=shipped("mcr/policies"))
    drawing = {item.name: item for item in Report(study=study).drawings()}["policies_replans"]
    often, causes, worth, delay = drawing.figure.axes
    assert [bar.get_width() for bar in causes.patches] == pytest.approx([25, 0, 75, 0, 0, 100])
    assert [bar.get_width() for bar in worth.patches] == pytest.approx([75, 40, 25, 60])
    assert {float(line.get_xdata()[0]) for line in often.lines if line.get_marker() == "o"} == {8.0, 10.0}
    assert [float(line.get_xdata()[0]) for line in delay.lines if line.get_marker() == "o"] == pytest.approx(
        [0.1]
    )


def test_causes_of_ones_own_are_drawn_after_those_shipped(tmp_path):
    arms = ("MCR", "TBR")
    table = rows_of(arms, ("a", "b"), 3, success=True, replans=12.0, useful_replans=6.0)
    shipped_causes = {cause_metric(cause).column: 1.0 for cause in COUNTED}
    table = table.assign(**shipped_causes, replans_mine=2.0)
    study = made_up(tmp_path, table, {"arm": arms, "scene": ("a", "b")}, report=shipped("mcr/policies"))
    drawing = {item.name: item for item in Report(study=study).drawings()}["policies_replans"]
    _, names = drawing.figure.axes[1].get_legend_handles_labels()
    assert names == [*COUNTED, "mine"]
    assert drawing.figure.axes[1].patches[-1].get_width() == pytest.approx(100.0 * 2.0 / (len(COUNTED) + 2.0))


def test_robustness_draws_every_level_at_its_mean(tmp_path):
    parts = []
    for noise, success in (("none", True), ("strong", False)):
        for latency in ("0 ms", "30 ms"):
            part = rows_of(("MCR",), ("a", "b"), 2, success=success, min_clearance_m=0.4, replans=1.0)
            parts.append(part.assign(noise=noise, latency=latency, completion_time_s=30.0))
    table = pd.concat(parts, ignore_index=True)
    table["trial"] = [f"t{number}" for number in range(len(table))]
    event = {"time_s": 1.0, "effective_s": 1.03, "cause": "map", "status": "ok", "path_change_m": 0.05}
    fired = table[table["noise"] == "strong"]["trial"]
    replans = pd.DataFrame(
        [
            {"trial": trial, "number": number, "near_change": True, **event}
            for trial in fired
            for number in (0, 1)
        ]
    )
    axes = {"arm": ("MCR",), "noise": ("none", "strong"), "latency": ("0 ms", "30 ms"), "scene": ("a", "b")}
    report = {"figures": [{"disturbances": {"arm": "MCR"}}]}
    study = made_up(tmp_path, table, axes, report=report, replans=replans)
    (drawing,) = Report(study=study).drawings()
    success, clearance, false = drawing.figure.axes
    for panel, expected in ((success, [100.0, 0.0]), (clearance, [0.4, 0.4]), (false, [0.0, 2.0])):
        drawn = [line for line in panel.lines if line.get_label() in axes["latency"]]
        assert len(drawn) == 2
        for line in drawn:
            np.testing.assert_allclose(line.get_ydata(), expected)
    assert FALSE_TRIGGERS.label == false.get_ylabel().replace("\n", " ")


def test_a_summary_has_a_row_per_arm(tmp_path):
    arms = tuple(f"arm {number}" for number in range(9))
    study = made_up(tmp_path, rows_of(arms, ("a",), 4, success=True), {"arm": arms, "scene": ("a",)})
    (drawing,) = Report(study=study).drawings()
    assert drawing.name == "success"
    assert len(drawing.figure.axes[0].get_yticklabels()) == 9


@pytest.mark.parametrize(
    ("numbers", "words"), [([3], "3"), ([0, 1, 2, 3], "0 to 3"), ([0, 2, 5], "0, 2, 5"), ([4, 5], "4, 5")]
)
def test_seeds_in_words(numbers, words):
    assert base.span(numbers) == words

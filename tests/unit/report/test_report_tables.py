"""Tables and verdicts of the report, on made-up trials whose answers are known."""

from __future__ import annotations

import csv
import io
import math
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from tests.studies import shipped
from uavexp.errors import RecordError
from uavexp.metrics.evaluate import metric_of
from uavexp.report import labels, number_format, table_formats
from uavexp.report.comparison import Panel, compare, estimate, pairs_of, panel_of
from uavexp.report.contents import Judgement, Report
from uavexp.report.derived import with_false_triggers
from uavexp.report.judges import Verdict
from uavexp.report.printed import read_reference, read_rows
from uavexp.report.results import Results
from uavexp.report.tables.base import Table
from uavexp.report.tables.by_arm import on_front
from uavexp.store.study import Study

SCENES = tuple(f"scene {number}" for number in range(10))
ARMS = ("SSP", "TBR", "TBR frequent", "MCR")
GOOD = {"rate": 1.0, "replans": 6.0, "clearance": 0.5, "path": 25.0}
BAD = {"rate": 0.4, "replans": 15.0, "clearance": 0.3, "path": 30.0}
WORST = {"rate": 0.0, "replans": 0.0, "clearance": 0.1, "path": 12.0}


def trials_of(
    arms: dict[str, dict[str, float]], seeds: int = 6, scenes: Sequence[str] = SCENES
) -> pd.DataFrame:
    rng = np.random.default_rng(0)
    rows = []
    for arm, look in arms.items():
        for place, scene in enumerate(scenes):
            for seed in range(seeds):
                success = (seed + 0.5) / seeds < look["rate"]
                rows.append(
                    {
                        "strategy": arm.split()[0].lower(),
                        "arm": arm,
                        "scene": scene,
                        "seed": seed,
                        "trial": f"{arm}-{scene}-{seed}",
                        "status": "ok",
                        "outcome": "reached" if success else "timeout",
                        "success": success,
                        "collision_count": 0.0 if success else 2.0,
                        "replans": look["replans"] + place,
                        "useful_replans": 0.5 * (look["replans"] + place),
                        "min_clearance_m": look["clearance"] + 0.01 * rng.random(),
                        "path_length_m": look["path"] + rng.random() + place,
                        "completion_time_s": 2.0 * look["path"] + rng.random(),
                        "tracking_error_m": 0.1 - 0.1 * look["clearance"],
                        "jerk_integral_m2ps5": 100.0 * look["path"],
                        "shortest_path_m": 20.0 + place,
                        "p_planner_unknown": "optimistic",
                    }
                )
    return pd.DataFrame(rows)


def study_of(trials: pd.DataFrame, report: dict[str, Any] | None = None, **settings: Any) -> Study:
    axes = {
        axis: tuple(sorted(trials[axis].unique(), key=[*ARMS, "none", *trials[axis].unique()].index))
        for axis in ("arm", "setting", "noise", "latency", "drift", "scene")
        if axis in trials
    }
    study = Study(
        folder=Path("nowhere"),
        name="mcr/table1",
        title="Made-up",
        report=shipped("mcr/table1") if report is None else report,
        axes=axes,
        seeds=(0, 1),
        settings={"primary": "MCR", "time_based": "TBR", **settings},
    )
    study.__dict__["measurements"] = trials  # what the folder would hold
    return study


def report_of(trials: pd.DataFrame, report: dict[str, Any] | None = None, **settings: Any) -> Report:
    return Report(study=study_of(trials, report, **settings))


@pytest.fixture(scope="module")
def trials() -> pd.DataFrame:
    return trials_of({"SSP": WORST, "TBR": BAD, "TBR frequent": {**GOOD, "replans": 20.0}, "MCR": GOOD})


def verdict_of(claims: Sequence[Judgement], words: str) -> Verdict:
    found = [claim.verdict for claim in claims if claim.statement == words]
    assert len(found) == 1, f"{words}: {[claim.statement for claim in claims]}"
    return found[0]


def column(table: Table, row: str, name: str) -> str:
    place = table.columns.index(name)
    return next(line[place] for line in table.rows if line[0] == row)


# ---- means ----------------------------------------------------------------------------------


def test_a_trial_that_did_not_run_to_its_end_is_a_failure_and_has_no_other_number(
    trials: pd.DataFrame,
) -> None:
    killed = trials.copy()
    one = (killed["arm"] == "MCR") & (killed["scene"] == "scene 3") & (killed["seed"] == 2)
    killed.loc[one, "status"] = "killed"
    killed.loc[one, "success"] = False
    numbers = killed.select_dtypes("float").columns
    killed.loc[one, numbers] = math.nan
    panel = Results(study=study_of(killed)).panel
    rate, path = estimate(panel, labels.RATE, "MCR"), estimate(panel, labels.PATH, "MCR")
    assert (rate.n, rate.mean) == (60, pytest.approx(100 * 59 / 60))
    assert path.n == 59
    assert path.mean == pytest.approx(killed.loc[killed["arm"] == "MCR", "path_length_m"].mean())
    cell = column(report_of(killed).tables[0], labels.PATH.label, "MCR")
    assert "(n = 59)" in cell
    assert compare(pairs_of(panel, "MCR", "TBR", [labels.PATH]), labels.PATH).pairs == 59
    assert compare(pairs_of(panel, "MCR", "TBR", [labels.RATE]), labels.RATE).pairs == 60


def test_success_spreads_over_scenes_and_measurements_over_flights(trials: pd.DataFrame) -> None:
    changed = trials.copy()
    changed.loc[(changed["arm"] == "MCR") & (changed["scene"] == "scene 0"), "success"] = False
    panel = Results(study=study_of(changed)).panel
    rate = estimate(panel, labels.RATE, "MCR")
    assert rate.sd == pytest.approx(np.std([0.0] + [100.0] * 9, ddof=1))
    path = changed.loc[changed["arm"] == "MCR", "path_length_m"]
    assert estimate(panel, labels.PATH, "MCR").sd == pytest.approx(path.std())


def test_order_of_trials_does_not_matter(trials: pd.DataFrame) -> None:
    shuffled = trials.sample(frac=1.0, random_state=1)
    first, second = (study_of(some) for some in (trials, shuffled))
    second.axes.update(first.axes)
    one, two = Report(study=first), Report(study=second)
    assert (one.tables, one.values, one.judgements) == (two.tables, two.values, two.judgements)


def test_names_of_seeds_do_not_matter_when_pairs_keep_together(trials: pd.DataFrame) -> None:
    renamed = trials.assign(seed=trials["seed"] + 1000)
    panels = [Results(study=study_of(some)).panel for some in (trials, renamed)]
    found = [compare(pairs_of(panel, "MCR", "TBR", [labels.PATH]), labels.PATH) for panel in panels]
    assert found[0] == found[1]


def test_pairing_makes_the_difference_sharper_than_its_parts(trials: pd.DataFrame) -> None:
    """Scenes differ by 10 m in path; the arms differ by 5 m in each of them."""
    panel = Results(study=study_of(trials)).panel
    paired = compare(pairs_of(panel, "MCR", "TBR", [labels.PATH]), labels.PATH).interval
    alone = estimate(panel, labels.PATH, "MCR").interval
    assert paired.high - paired.low < 0.5 * (alone.high - alone.low)
    assert paired.low < -5.0 < paired.high


def test_two_trials_of_one_arm_in_one_world_are_refused(trials: pd.DataFrame) -> None:
    twice = pd.concat([trials, trials.iloc[:1]])
    with pytest.raises(RecordError, match="two trials of one arm"):
        panel_of(twice, "arm", ["SSP"])


def test_a_world_that_one_arm_has_not_flown_yet_makes_no_pair(trials: pd.DataFrame) -> None:
    unfinished = trials[~((trials["arm"] == "TBR") & (trials["seed"] > 2))]
    panel = Results(study=study_of(unfinished)).panel
    assert panel.n("TBR") == 30
    assert estimate(panel, labels.RATE, "TBR").n == 30
    assert compare(pairs_of(panel, "MCR", "TBR", [labels.RATE]), labels.RATE).pairs == 30


# ---- table 1 --------------------------------------------------------------------------------


def test_table_1_shows_the_papers_value_beside_ours(trials: pd.DataFrame) -> None:
    table = report_of(trials).tables[0]
    assert table.columns == ("", "SSP", "TBR", "TBR frequent", "MCR")
    assert column(table, "Trials, n", "MCR") == "60"
    assert column(table, labels.RATE.label, "MCR").startswith("100.0 ± 0.0 [94.0, 100.0] (paper: 96 ± 3.2)")
    assert "(paper: 31.4 ± 2.6)" in column(table, labels.PATH.label, "SSP")
    assert "paper" not in column(table, labels.PATH.label, "TBR frequent")
    assert any("78.6 ± 64" in note for note in table.notes)
    assert any("optimistic" in note for note in table.notes)


def test_claims_that_hold_are_reproduced_and_others_are_not(trials: pd.DataFrame) -> None:
    claims = report_of(trials).judgements
    for words in (
        "MCR has a higher success rate than TBR",
        "MCR has a higher success rate than SSP",
        "TBR has a higher success rate than SSP",
        "MCR has fewer replans than TBR",
        "MCR has a shorter path than TBR",
    ):
        assert verdict_of(claims, words) is Verdict.REPRODUCED, words
    assert verdict_of(claims, "MCR has a higher success rate than TBR frequent") is Verdict.NOT_SHOWN
    # none in 60 flights: 6 % might still have one
    assert verdict_of(claims, "MCR incurs no collision") is Verdict.NOT_SHOWN
    # SSP never arrives: its short path is no shorter path
    assert verdict_of(claims, "MCR has a shorter path than SSP") is Verdict.NOT_TESTABLE


def test_the_opposite_contradicts(trials: pd.DataFrame) -> None:
    swapped = trials.assign(arm=trials["arm"].replace({"MCR": "TBR", "TBR": "MCR"}))
    claims = report_of(swapped).judgements
    assert verdict_of(claims, "MCR has a higher success rate than TBR") is Verdict.CONTRADICTED
    assert verdict_of(claims, "MCR has fewer replans than TBR") is Verdict.CONTRADICTED
    assert verdict_of(claims, "MCR incurs no collision") is Verdict.CONTRADICTED


def test_with_few_scenes_worlds_are_the_units_and_the_tables_say_so() -> None:
    arms = {"TBR": BAD, "MCR": {**GOOD, "rate": 0.6}}
    few = report_of(trials_of(arms, seeds=30, scenes=SCENES[:4]))
    many = report_of(trials_of(arms, seeds=12))
    words = "MCR has a higher success rate than TBR"
    assert verdict_of(few.judgements, words) is verdict_of(many.judgements, words) is Verdict.REPRODUCED
    assert any("not of other scenes" in note for note in few.tables[0].notes)
    assert not any("not of other scenes" in note for note in many.tables[0].notes)


def test_too_few_common_successes_cannot_be_tested(trials: pd.DataFrame) -> None:
    rare = trials.copy()
    rare.loc[(rare["arm"] == "TBR") & (rare["scene"] > "scene 3"), "success"] = False
    claims = report_of(rare).judgements
    assert verdict_of(claims, "MCR has a shorter path than TBR") is Verdict.NOT_TESTABLE
    assert verdict_of(claims, "MCR has a higher success rate than TBR") is Verdict.REPRODUCED


def test_a_study_without_the_papers_arms_makes_tables_and_no_direction(trials: pd.DataFrame) -> None:
    other = trials[trials["arm"] == "TBR frequent"].assign(arm="mine")
    found = report_of(other)
    assert found.tables[0].columns == ("", "mine")
    assert all(claim.verdict is Verdict.NOT_TESTABLE for claim in found.judgements)


def test_saved_replans_are_judged_by_the_interval_of_the_ratio(trials: pd.DataFrame) -> None:
    exact = trials.copy()
    exact.loc[exact["arm"] == "TBR", "replans"] = 10.0
    exact.loc[exact["arm"] == "MCR", "replans"] = 4.2 + 0.1 * (exact["seed"] % 2 - 0.5)
    claims = report_of(exact).judgements
    assert verdict_of(claims, "MCR replans 58 % less often than TBR") is Verdict.REPRODUCED
    assert verdict_of(claims, "MCR replans 58 % less often than TBR frequent") is Verdict.CONTRADICTED


@pytest.mark.parametrize(
    ("judge", "verdict"),
    [
        ({"judge": "none", "at_most_percent": 7.0, "event": "a collision"}, Verdict.REPRODUCED),
        ({"judge": "none", "at_most_percent": 6.0, "event": "a collision"}, Verdict.NOT_SHOWN),
        ({"judge": "none", "event": "a collision", "arms": ["SSP"]}, Verdict.CONTRADICTED),
        # Table 1 prints 96 %, we have 100 [94.0, 100.0]
        ({"judge": "value", "metric": "success", "margin": 5.0}, Verdict.REPRODUCED),
        ({"judge": "value", "metric": "success", "margin": 3.0}, Verdict.NOT_SHOWN),
        ({"judge": "value", "metric": "success", "margin": 3.0, "arms": ["SSP"]}, Verdict.CONTRADICTED),
        # Table 1 prints 6.1 replans
        ({"judge": "value", "metric": "replans", "margin": 99.0}, Verdict.REPRODUCED),
        ({"judge": "value", "metric": "replans"}, Verdict.CONTRADICTED),
    ],
    ids=str,
)
def test_equivalence_is_judged_by_a_margin(
    trials: pd.DataFrame, judge: dict[str, Any], verdict: Verdict
) -> None:
    claim = {"says": "it", "source": "-", "metric": "collision_count", "arms": ["MCR"], **judge}
    assert verdict_of(report_of(trials, {"claims": [claim]}).judgements, "it") is verdict


def test_a_worsening_is_ruled_out_or_shown_or_neither(trials: pd.DataFrame) -> None:
    for margin, verdict in ((50.0, Verdict.REPRODUCED), (0.5, Verdict.CONTRADICTED)):
        claim = {"judge": "no_worse", "metric": "replans", "margin": margin, "arms": ["TBR frequent", "MCR"]}
        claims = [{"says": "it", "source": "-", **claim}]
        assert verdict_of(report_of(trials, {"claims": claims}).judgements, "it") is verdict


def test_worse_in_a_scene_by_chance_contradicts_nothing(trials: pd.DataFrame) -> None:
    words = "The trends are the same in every scene: MCR succeeds no less often than TBR"
    assert verdict_of(report_of(trials).judgements, words) is Verdict.NOT_TESTABLE  # six worlds a scene
    one = trials_of({"TBR": BAD, "MCR": GOOD}, seeds=12)
    assert verdict_of(report_of(one).judgements, words) is Verdict.REPRODUCED
    there = (one["scene"] == one["scene"].iloc[0]) & one["arm"].isin(["MCR", "TBR"])
    first = one["seed"] == one["seed"].min()
    one.loc[there, "success"] = True
    one.loc[there & first & (one["arm"] == "MCR"), "success"] = False
    assert verdict_of(report_of(one).judgements, words) is Verdict.NOT_SHOWN
    many = trials_of({"TBR": GOOD, "MCR": GOOD}, seeds=30)
    worse = many["scene"] == many["scene"].iloc[0]
    many.loc[worse & (many["arm"] == "MCR"), "success"] = False
    assert verdict_of(report_of(many).judgements, words) is Verdict.CONTRADICTED


# ---- the paper's own numbers ----------------------------------------------------------------


def test_reference_holds_table_1_of_the_paper() -> None:
    reference = read_reference("mcr/table1")
    assert len(reference) == 7 * 3
    assert {name for name, _ in reference} == {metric.column for metric in labels.TABLE_1}
    assert reference["completion_time_s", "SSP"].sd == 6.4
    assert math.isnan(reference["replans", "SSP"].sd)
    assert read_reference("nobody/knows") == {}


def least_spread(mean: float, share_of_zeros: float) -> float:
    """Least standard deviation of a count >= 0 with this mean, zero in such a share of cases."""
    return mean * math.sqrt(share_of_zeros / (1.0 - share_of_zeros)) if share_of_zeros < 1.0 else 0.0


def possible_rate(percent: float, trials: int) -> bool:
    """Whether a percentage, printed with one decimal, is a count out of so many trials."""
    return abs(100.0 * round(percent * trials / 100.0) / trials - percent) < 0.05 + 1e-9


def test_least_spread_is_reached_by_zero_and_one_other_value() -> None:
    counts = np.array([0.0] * 7 + [14.0] * 3)
    assert counts.mean() == pytest.approx(4.2)
    assert least_spread(4.2, 0.7) == pytest.approx(counts.std())
    rng = np.random.default_rng(0)
    for _ in range(200):
        counts = np.concatenate([np.zeros(7), rng.gamma(0.5, 10.0, 3)])
        assert counts.std() >= least_spread(counts.mean(), 0.7) - 1e-9


def test_contradictions_of_paper_1_are_those_that_arithmetic_finds() -> None:
    found = {row["printed"]: row["check"] for row in read_rows("mcr/table1", "contradictions.csv")}
    reference = read_reference("mcr/table1")
    for arm in ("TBR", "SSP", "MCR"):
        rate, contacts = reference["success", arm].mean, reference["collision_count", arm]
        impossible = [str(n) for n in (10, 20) if not possible_rate(rate, n)]
        said = found.get(f"{arm}: success rate {rate:g} %", "no count out of  trials")
        assert said == f"no count out of {' or '.join(impossible)} trials"
        least = least_spread(contacts.mean, rate / 100.0)
        words = (
            f"{arm}: {rate:g} % of flights without collision, {contacts.mean:g} ± {contacts.sd:g} collisions"
        )
        assert found.get(words) == (
            f"the spread must be at least {least:.1f}" if contacts.sd < least else None
        )
        speed = reference["path_length_m", arm].mean / reference["completion_time_s", arm].mean
        assert found[f"{arm}: path over time"].startswith(f"{speed:.2f} m/s")
    interval_s = reference["completion_time_s", "TBR"].mean / reference["replans", "TBR"].mean
    assert found["TBR: the interval is never given"].endswith(f"= {interval_s:.1f} s")


# ---- other reports --------------------------------------------------------------------------


def test_front_by_hand() -> None:
    points = np.array([[1.0, 1.0], [2.0, 0.0], [0.0, 2.0], [0.9, 0.9], [1.0, 1.0], [math.nan, 9.0]])
    assert on_front(points).tolist() == [True, True, True, False, True, False]


def test_systems_that_were_not_flown_stand_below_with_what_is_printed_of_them(trials: pd.DataFrame) -> None:
    flown = trials[trials["arm"] != "TBR"]
    metrics = ["success", "replans", "detour"]
    for front in (False, True):
        asked = {"tables": [{"by_arm": {"metrics": metrics, "printed": True, "front": front}}]}
        (table,) = report_of(flown, asked, name="mcr/table1").tables
        last = table.rows[-1]
        assert [row[0] for row in table.rows] == ["SSP", "TBR frequent", "MCR", "TBR"]
        assert last[2:4] == ("85.0", "14.6")
        assert column(table, "TBR", "n") == ""
    (plain,) = report_of(flown, {"tables": [{"by_arm": {"metrics": metrics}}]}, name="mcr/table1").tables
    assert len(plain.rows) == 3


def test_a_table_of_some_scenes_is_that_of_their_trials_alone(trials: pd.DataFrame) -> None:
    scene = trials["scene"].iloc[0]
    metrics = ["success", "replans"]
    alone = {"tables": [{"by_arm": {"metrics": metrics, "name": "a"}}]}
    for rows, patterns in ((trials[trials["scene"] == scene], [scene]), (trials, ["*"])):
        some = {"tables": [{"by_arm": {"metrics": metrics, "name": "a", "scenes": patterns}}]}
        assert report_of(trials, some).tables[0].rows == report_of(rows, alone).tables[0].rows
    none = {"tables": [{"by_arm": {"metrics": metrics, "scenes": ["nowhere"]}}]}
    assert report_of(trials, none).tables == ()


BEATS = "MCR beats {}: as much success and clearance with fewer replans"


def trade_offs(*pairs: Sequence[str]) -> dict[str, Any]:
    claim = {"says": BEATS.format("{second}"), "source": "§4.3", "judge": "trade_off", "each": list(pairs)}
    metrics = ["success", "min_clearance_m", "replans"]
    return {"tables": [{"by_arm": {"metrics": metrics, "front": True}}], "claims": [claim]}


def test_mcr_beats_an_interval_only_with_fewer_replans_at_no_loss(trials: pd.DataFrame) -> None:
    asked = trade_offs(["MCR", "TBR"], ["MCR", "TBR frequent"])
    claims = report_of(trials, asked).judgements
    assert verdict_of(claims, BEATS.format("TBR")) is Verdict.REPRODUCED
    assert verdict_of(claims, BEATS.format("TBR frequent")) is Verdict.REPRODUCED
    for worse in ({"replans": 30.0}, {"clearance": 0.4}, {"rate": 0.8}):
        arms = {"TBR": {**GOOD, "replans": 12.0}, "MCR": {**GOOD, **worse}}
        claims = report_of(trials_of(arms), asked).judgements
        assert verdict_of(claims, BEATS.format("TBR")) is Verdict.CONTRADICTED, worse
        assert len(claims) == 1  # of a pair that was not flown nothing is said


def test_one_setting_or_the_best_of_several_stands_for_mcr(trials: pd.DataFrame) -> None:
    settings = trials["arm"].map({"MCR": "x=1", "TBR": "interval_s=5"}).fillna("")
    swept = trials.assign(arm=trials["arm"].replace({"TBR frequent": "MCR"}), setting=settings)
    swept.loc[(swept["arm"] == "MCR") & (swept["setting"] == ""), "setting"] = "x=2"
    clock = "TBR, interval_s=5"
    asked = trade_offs(["MCR, x=1", clock], ["MCR, x=2", clock], ["MCR, x=1", "MCR, x=2", clock])
    found = report_of(swept, asked)
    assert [row[0] for row in found.tables[0].rows] == ["SSP", clock, "MCR, x=2", "MCR, x=1"]
    for judged, replans, arms in zip(found.judgements, ("-9.0", "+5.0", "-9.0"), (1, 1, 2), strict=True):
        assert f"replans {replans}" in judged.evidence
        assert f"Holm over {arms} arms" in judged.evidence


def test_a_count_that_never_occurred_is_bounded_and_other_equal_values_have_no_interval() -> None:
    trials = trials_of({"MCR": GOOD}).assign(time_below_safety_s=0.0)
    panel = Results(study=study_of(trials)).panel
    contacts, unsafe, replans = (
        number_format.mean_with_interval(estimate(panel, metric, "MCR"), metric, 60)
        for metric in (labels.CONTACTS, metric_of("time_below_safety_s"), labels.REPLANS)
    )
    assert contacts == "0.00 [0.00, 0.06]"  # 3.69 / 60
    assert unsafe == "0.00"
    assert replans.startswith("10.5 [")


def test_trials_of_two_versions_say_so() -> None:
    trials = trials_of({"MCR": GOOD}).assign(code="a" * 12)
    assert not any("pooled" in note for note in report_of(trials, {}).tables[0].notes)
    trials.loc[:6, "code"] = "b" * 12
    (note,) = [note for note in report_of(trials, {}).tables[0].notes if "pooled" in note]
    assert "2 versions" in note
    assert f"53 of {'a' * 12}, 7 of {'b' * 12}" in note


def disturbed(noisy_false_triggers: int) -> Study:
    levels = [("none", "0"), ("low", "0"), ("none", "0.1"), ("low", "0.1")]
    parts = [trials_of({"MCR": GOOD}).assign(noise=noise, latency=latency) for noise, latency in levels]
    trials = pd.concat(parts, ignore_index=True).drop(columns="arm")
    trials["trial"] = [f"trial-{number}" for number in range(len(trials))]
    base = {"number": 1, "status": "ok", "cause": "map", "effective_s": 1.0, "path_change_m": 0.01}
    replans = [
        {**base, "trial": row.trial}
        for row in trials.itertuples()
        for _ in range(noisy_false_triggers if row.noise == "low" else 0)
    ]
    useful = [{**base, "trial": "trial-0", "path_change_m": 2.0}, {**base, "trial": "trial-0", "number": 0}]
    late = [{**base, "trial": "trial-0", "effective_s": 1e9}, {**base, "trial": "trial-0", "cause": "goal"}]
    common = {"source": "§4.5", "judge": "no_worse"}
    noise = {"metric": "false_triggers_per_min", "margin": 1.0, "among": {"latency": "0"}}
    latency = {"metric": "success", "margin": 5.0, "among": {"noise": "none"}}
    claims = [
        {"says": "noise {first}", **common, **noise, "arms": ["low", "none"]},
        {"says": "latency {first}", **common, **latency, "arms": ["0.1", "0"]},
    ]
    study = study_of(trials, {"claims": claims})
    study.__dict__["replans"] = pd.DataFrame([*replans, *useful, *late])
    return study


def test_false_triggers_are_map_replans_that_changed_nothing() -> None:
    study = disturbed(noisy_false_triggers=3)
    with_rates = with_false_triggers(study.measurements, study.replans)
    low = with_rates["noise"] == "low"
    expected = 3.0 / (with_rates["completion_time_s"] / 60.0)
    np.testing.assert_allclose(with_rates.loc[low, "false_triggers_per_min"], expected[low])
    assert (with_rates.loc[~low, "false_triggers_per_min"] == 0.0).all()


def test_noise_that_fires_the_trigger_and_noise_that_does_not() -> None:
    for count, verdict in ((0, Verdict.REPRODUCED), (3, Verdict.CONTRADICTED)):
        claims = Report(study=disturbed(count)).judgements
        assert verdict_of(claims, "noise low") is verdict
        assert verdict_of(claims, "latency 0.1") is Verdict.REPRODUCED


@pytest.mark.parametrize(
    ("tolerant", "verdict"),
    [
        (GOOD, Verdict.REPRODUCED),
        (BAD, Verdict.NOT_SHOWN),
        ({**BAD, "clearance": 0.2}, Verdict.NOT_SHOWN),  # in success it is as good
    ],
)
def test_drift_and_the_thresholds_against_it(tolerant: dict[str, float], verdict: Verdict) -> None:
    none, severe = trials_of({"MCR": GOOD, "other": GOOD}), trials_of({"MCR": BAD, "other": tolerant})
    trials = pd.concat([none.assign(drift="none"), severe.assign(drift="severe")], ignore_index=True)
    common = {"source": "§4.5", "judge": "better_in_any", "metrics": ["success", "min_clearance_m"]}
    claims = [
        {"says": "drift", **common, "among": {"arm": "MCR"}, "arms": ["none", "severe"]},
        {"says": "tuned", **common, "among": {"drift": "severe"}, "arms": ["other", "MCR"]},
    ]
    judged = report_of(trials, {"claims": claims}).judgements
    assert verdict_of(judged, "drift") is Verdict.REPRODUCED
    assert verdict_of(judged, "tuned") is verdict
    assert "p times 2" in judged[0].evidence


@pytest.mark.parametrize("report", [shipped("mcr/policies"), {}], ids=["policies", "summary"])
def test_other_reports_have_a_row_per_arm_with_n(trials: pd.DataFrame, report: dict[str, Any]) -> None:
    table = report_of(trials, report).tables[0]
    assert [row[0] for row in table.rows] == ["SSP", "TBR", "TBR frequent", "MCR"]
    assert column(table, "MCR", "n") == "60"
    assert column(table, "MCR", labels.RATE.label) == "100.0 [94.0, 100.0]"


# ---- csv, Markdown, LaTeX -------------------------------------------------------------------

AWKWARD = Table(
    name="awkward",
    title="50 % of a_b & c",
    columns=("", "first|second", "note"),
    rows=(("[1, 2]", 'say "a, b"', "± 3 m²"), ("x", "#1 {y} ~ ^ \\", "$5 < 6")),
    notes=("n = 3.",),
)


def test_csv_gives_the_cells_back() -> None:
    rows = list(csv.reader(io.StringIO(table_formats.to_csv(AWKWARD))))
    assert [tuple(row) for row in rows] == [AWKWARD.columns, *AWKWARD.rows]


def test_markdown_lines_are_as_wide_as_each_other() -> None:
    lines = [line for line in table_formats.to_markdown(AWKWARD).splitlines() if line.startswith("|")]
    assert len(lines) == 4
    assert len({len(line) for line in lines}) == 1
    assert r"first\|second" in lines[0]


def test_latex_is_escaped_and_balanced() -> None:
    text = table_formats.to_latex(AWKWARD)
    body = text.split(r"\midrule")[1].split(r"\bottomrule")[0]
    assert body.strip().splitlines()[0].startswith("{}[1, 2]")  # else \\ takes it for a length
    assert r"\#1 \{y\} \textasciitilde{} \textasciicircum{} \textbackslash{}" in body
    assert r"\$5 $<$ 6" in body
    for name in ("table", "tabular"):
        assert text.count(rf"\begin{{{name}}}") == text.count(rf"\end{{{name}}}") == 1
    unescaped = re.sub(r"\\[{}]", "", text)
    assert unescaped.count("{") == unescaped.count("}")
    assert all(len(re.findall(r"(?<!\\)&", line)) == 2 for line in body.strip().splitlines())


def test_every_sign_of_the_reports_has_a_latex_form(trials: pd.DataFrame) -> None:
    for report in (shipped("mcr/table1"), shipped("mcr/policies"), trade_offs(["MCR", "TBR"]), {}):
        found = report_of(trials, report)
        for table in (*found.tables, found.claims):
            foreign = {sign for sign in table_formats.to_latex(table) if ord(sign) > 126}
            assert not foreign, f"{table.name}: {foreign}"


def test_numbers_never_read_minus_zero() -> None:
    assert number_format.number(-0.001, 2) == "0.00"
    assert number_format.signed(0.004, 2) == "0.00"
    assert number_format.signed(0.006, 2) == "+0.01"
    assert number_format.number(math.nan, 2) == number_format.NONE
    assert number_format.p_value(0.0004) == "<0.001"


def of_two_scenes(trials: pd.DataFrame) -> Panel:
    """Clearance was measured in two scenes of the ten."""
    few = trials.copy()
    few.loc[few["scene"] > "scene 1", "min_clearance_m"] = math.nan
    return Results(study=study_of(few)).panel


def test_a_metric_of_two_scenes_of_ten_has_the_interval_of_two(trials: pd.DataFrame) -> None:
    """With two units Student's t asks for all that was resampled."""
    panel = of_two_scenes(trials)
    means = panel.samples(labels.CLEARANCE)[:, panel.arms.index("MCR")]
    ends = estimate(panel, labels.CLEARANCE, "MCR").interval
    assert ends == pytest.approx((np.nanmin(means), np.nanmax(means)))


def test_a_difference_of_two_scenes_of_ten(trials: pd.DataFrame) -> None:
    panel = of_two_scenes(trials)
    pairs = pairs_of(panel, "MCR", "TBR", [labels.CLEARANCE])
    means = pairs.samples[labels.CLEARANCE.column]
    assert compare(pairs, labels.CLEARANCE).interval == pytest.approx((np.nanmin(means), np.nanmax(means)))


def test_flights_that_were_lost_bound_no_count() -> None:
    trials = trials_of({"MCR": GOOD})
    trials.loc[:9, "collision_count"] = math.nan
    panel = Results(study=study_of(trials)).panel
    assert estimate(panel, labels.CONTACTS, "MCR").interval.high == pytest.approx(-math.log(0.025) / 50)

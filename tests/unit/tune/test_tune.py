"""Tuning: what is asked is what is drawn, the front is the front, and the same command goes on."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from tests.sweeps import QUICK
from uavexp.__main__ import main
from uavexp.config.composition import Composer
from uavexp.errors import ConfigError
from uavexp.tune.__main__ import task_of
from uavexp.tune.objective import front, means, objectives
from uavexp.tune.search import _cells, _study
from uavexp.tune.space import Choice, Range, label_of, split, wholes_checked

optuna = pytest.importorskip("optuna", reason="tuning is an extra: pip install 'uavexp[tune]'")
TBR = ("tune", *QUICK, "strategy=tbr", "trigger.interval_s=0.2:6", "seed=100:102", "runner.n_jobs=1")


class TestSpace:
    def test_ranges_and_choices_are_tuned_and_all_else_is_flown_as_typed(self) -> None:
        words = [
            "strategy=tbr",
            "trigger.a=0.5:5",
            "trigger.b=1:10",
            "c=0.1:10:log",
            "d=choice(x,2)",
            "seed=100:110",
        ]
        tuned, others = split(words)
        assert others == ["strategy=tbr", "seed=100:110"]
        assert tuned == [
            Range(key="trigger.a", low=0.5, high=5.0, is_log=False, is_whole=False),
            Range(key="trigger.b", low=1.0, high=10.0, is_log=False, is_whole=True),
            Range(key="c", low=0.1, high=10.0, is_log=True, is_whole=False),
            Choice(key="d", values=("x", 2)),
        ]

    @pytest.mark.parametrize("item", [
        Range(key="x", low=0.30001, high=0.30002, is_log=False, is_whole=False),
        Range(key="x", low=1.0, high=3.0, is_log=True, is_whole=True),
        Choice(key="x", values=("min_acc", None, 2)),
    ])  # fmt: skip
    def test_what_is_drawn_may_be_tried(self, item: Range | Choice) -> None:
        study = optuna.create_study(sampler=optuna.samplers.RandomSampler(seed=1))
        for _ in range(20):
            assert item.holds(item.suggest(study.ask()))

    @pytest.mark.parametrize(("word", "told"), [
        ("a=5:0.5", "the range is empty"), ("a=0:5:log", "must begin above 0"),
    ])  # fmt: skip
    def test_a_range_that_holds_nothing_is_refused(self, word: str, told: str) -> None:
        with pytest.raises(ConfigError, match=told):
            split([word])

    def test_a_label_reads_back(self) -> None:
        assert label_of({"trigger.interval_s": 0.5, "planner": "astar"}) == "interval_s=0.5 planner=astar"


class TestObjective:
    def test_a_flight_that_was_lost_is_a_failure_and_has_no_clearance(self) -> None:
        rows = [
            {"success": True, "min_clearance_m": 0.4, "replans": 2},
            {"success": False, "min_clearance_m": None, "replans": None},
        ]
        assert means(objectives("success,min_clearance_m,replans"), rows) == (50.0, 0.4, 2.0)
        assert means(objectives("min_clearance_m"), rows[1:]) is None

    def test_the_front_is_what_no_other_beats(self) -> None:
        metrics = objectives("success,replans")
        #                       beaten by 2  best     best of few  equal to 1   worse than both
        values = [(90.0, 9.0), (100.0, 8.0), (95.0, 3.0), (100.0, 8.0), (94.0, 4.0)]
        assert front(metrics, values) == [1, 3, 2]

    def test_what_is_better_in_neither_direction_is_no_objective(self) -> None:
        with pytest.raises(ConfigError, match="neither more nor less"):
            objectives("replans_map")


class TestTask:
    def test_an_experiment_gives_its_scenes_and_one_arm(self) -> None:
        words = ["experiments=mcr/table1", "arm=TBR", "trigger.interval_s=0.5:5", "budget=3"]
        task = task_of(words, Composer())
        assert len(task.base.axes["scene"]) == len(task.base.cells) == 10
        assert task.base.seeds == tuple(range(100, 110))  # none that a comparison uses
        assert task.budget == 3
        assert task.tuned[0].is_whole is False

    def test_the_first_settings_leave_no_gap(self) -> None:
        words = ["strategy=tbr", "trigger.interval_s=0.5:8:log", "sensor=choice(rgbd,lidar_spinning)"]
        task = task_of(words, Composer())
        study, tried = _study(task), []
        for _ in range(7):
            trial = study.ask()
            tried.append([item.suggest(trial) for item in task.tuned])
            study.tell(trial, [100.0, 0.5, 5.0])
        assert tried[0] == [5.0, "rgbd"], "the values that are there now"
        spread = np.log2([interval_s for interval_s, _ in tried])
        assert np.diff(np.sort(spread)).max() <= 1.0, "of the range's four octaves"
        assert {sensor for _, sensor in tried[1:]} == {"rgbd", "lidar_spinning"}

    @pytest.mark.parametrize(("words", "told"), [
        (["strategy=tbr"], "nothing is tuned"),
        (["trigger.interval_s=1:2", "strategy=tbr", "budget=0"], "budget=0 must be a whole number"),
        (["trigger.interval_s=1:2", "strategy=tbr", "objective=sucess"], "did you mean"),
        (["experiments=mcr/table1", "trigger.interval_s=1:2"], "one arm is tuned at a time; pick it"),
    ])  # fmt: skip
    def test_what_cannot_be_tuned_is_told(self, words: list[str], told: str) -> None:
        with pytest.raises(ConfigError, match=told):
            task_of(words, Composer())


def test_the_same_command_flies_nothing_again_and_a_larger_budget_goes_on(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "tuned"
    assert main([*TBR, "budget=2", f"out={folder}"]) == 0
    first = pd.read_parquet(folder / "trials.parquet")
    assert list(first["candidate"].unique()) == ["interval_s=5.0", first["candidate"].iloc[-1]]
    assert set(first["p_trigger_interval_s"].round(3)) >= {5.0}  # the parameter's own value is tried first
    capsys.readouterr()
    assert main([*TBR, "budget=2", f"out={folder}"]) == 0
    assert "flying" not in capsys.readouterr().out
    assert main([*TBR, "budget=3", f"out={folder}"]) == 0
    more = pd.read_parquet(folder / "trials.parquet")
    assert len(more) == 6
    assert set(first["trial"]) < set(more["trial"])
    assert "beaten by none" in capsys.readouterr().out


def test_a_parameter_that_does_not_exist_is_told(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    assert main(["tune", "strategy=tbr", "trigger.intervall_s=1:2", f"out={tmp_path / 'x'}"]) == 2
    error = capsys.readouterr().err
    assert "trigger.intervall_s: option tbr of trigger has no parameter" in error
    assert "did you mean" in error


def test_a_share_of_a_range_lies_as_far_in_it() -> None:
    even = Range(key="x", low=2.0, high=6.0, is_log=False, is_whole=False)
    assert [even.at(share) for share in (0.0, 0.5, 1.0)] == [2.0, 4.0, 6.0]
    log = Range(key="x", low=1.0, high=100.0, is_log=True, is_whole=True)
    assert [log.at(share) for share in (0.0, 0.5, 1.0)] == pytest.approx([1, 10, 100])
    three = Choice(key="x", values=("a", "b", "c"))
    assert [three.at(share) for share in (0.0, 0.34, 0.99)] == ["a", "b", "c"]


def test_more_of_what_is_better_is_asked_for_and_less_of_what_is_worse() -> None:
    words = ["strategy=tbr", "trigger.interval_s=1:5", "objective=success,min_clearance_m,replans"]
    directions = [direction.name for direction in _study(task_of(words, Composer())).directions]
    assert directions == ["MAXIMIZE", "MAXIMIZE", "MINIMIZE"]


def test_what_is_tried_goes_before_what_the_arm_has() -> None:
    composer = Composer()
    task = task_of(["experiments=mcr/table1", "arm=TBR", "trigger.interval_s=0.5:5"], composer)
    cells = list(_cells(task.base, composer, "interval_s=1.25", {"trigger.interval_s": 1.25}))
    assert len(cells) == len(task.base.cells)
    assert {cell.config["trigger"]["interval_s"] for cell in cells} == {1.25}


def test_a_whole_number_stays_one() -> None:
    item = Range(key="x", low=1.0, high=10.0, is_log=False, is_whole=True)
    for default, is_whole in ((3, True), (3.0, False), (True, False), (None, False)):
        (checked,) = wholes_checked([item], {"x": default}.get)
        assert checked.is_whole is is_whole

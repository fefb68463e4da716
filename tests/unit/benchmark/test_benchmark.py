"""The suite is fixed; an entry flies it as anybody else does, and is put beside them by the same numbers."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from tests.studies import made_up
from uavexp.benchmark.__main__ import main
from uavexp.benchmark.entry import SUITE, entry_of, part_of
from uavexp.benchmark.standings import WHOLE, in_common, numbers, rows_of, standings
from uavexp.config.composition import Composer
from uavexp.config.experiment import read_experiment
from uavexp.config.overrides import parse_settings
from uavexp.errors import RecordError
from uavexp.store.parts import check_table
from uavexp.store.table import FIRST, write_table

COMPOSER = Composer()
V1 = read_experiment(SUITE, COMPOSER.experiments[SUITE])
FEW = replace(V1, axes={**V1.axes, "scene": dict(list(V1.axes["scene"].items())[::9])})


def test_suite_v1_is_what_it_was() -> None:
    """Another suite is another file: results of v1 stay comparable."""
    parts = [part_of(scene) for scene in V1.axes["scene"]]
    assert {part: parts.count(part) for part in parts} == {
        "generated": 14,
        "BARN": 50,
        "movers": 5,
        "real": 9,
    }
    assert V1.seed == "1000:1010"
    numbers_flown = [
        setting.values[0]
        for scene, settings in V1.axes["scene"].items()
        for setting in settings
        if part_of(scene) == "BARN" and setting.key == "world.number"
    ]
    assert numbers_flown == list(range(0, 300, 6))


@pytest.fixture(scope="module")
def mine():
    typed = parse_settings(["trigger=tbr", "trigger.interval_s=2.5", "runner.n_jobs=2"])
    return entry_of(COMPOSER, FEW, "mine", typed, fast=True, out="nowhere")


def test_an_entry_flies_its_policy_in_every_scene_and_nothing_else_of_its_own(mine) -> None:
    command, left_out = mine
    assert {part_of(scene) for scene in left_out} <= {"real"}
    assert len(command.cells) == len(FEW.axes["scene"]) - len(left_out)
    assert {cell.options["trigger"] for cell in command.cells} == {"tbr"}
    assert {cell.config["trigger"]["interval_s"] for cell in command.cells} == {2.5}
    assert {cell.labels["arm"] for cell in command.cells} == {"mine"}
    assert command.runner["n_jobs"] == 2
    built_in = {
        cell.labels["scene"]: {
            group: cell.options[group] for group in ("planner", "sensor", "safety", "world")
        }
        for cell in entry_of(COMPOSER, FEW, "other", parse_settings(["trigger=mcr"]), fast=True, out="x")[
            0
        ].cells
    }
    for cell in command.cells:
        assert {key: cell.options[key] for key in built_in[cell.labels["scene"]]} == built_in[
            cell.labels["scene"]
        ]


def test_fast_is_a_tenth_of_the_seeds(mine) -> None:
    assert mine[0].seeds == (1000,)


def test_what_cannot_be_an_entry_is_told(capsys: pytest.CaptureFixture[str]) -> None:
    for words, told in (
        (["trigger=mcr", "name=MCR"], "a built-in policy is called so"),
        (["trigger=mcr", "seed=0"], "the suite's own, the same for every entry"),
        (["trigger=mcr", "world.density_per_m2=0.01"], "the suite's own, the same for every entry"),
        (["trigger=tbr", "trigger.interval_s=1,2"], "an entry is one policy"),
        (["--fast", "trigger=mcr"], "no such flag: --fast"),
    ):
        assert main(words) == 2
        assert told in capsys.readouterr().err


def rows() -> pd.DataFrame:
    scenes = ["BARN: 0", "BARN: 6", "movers: hall"]
    flights = [(arm, scene, seed) for arm in ("mine", "MCR") for scene in scenes for seed in (1000, 1001)]
    made = pd.DataFrame(flights, columns=["arm of all axes", "scene", "seed"])
    slower = np.where(made["arm of all axes"] == "mine", 2.0, 1.0)
    return made.assign(
        success=made["scene"] != "BARN: 6", collision_count=0, spl=0.5, completion_time_s=10.0 * slower,
        replans=7, compute_s=slower,
    )  # fmt: skip


def test_all_stand_beside_each_other_in_the_same_worlds() -> None:
    made = rows()
    mine, others = made[made["arm of all axes"] == "mine"], made[made["arm of all axes"] == "MCR"]
    there = in_common(mine, others[others["seed"] == 1000])
    assert set(there["seed"]) == {1000}
    assert there.groupby("arm of all axes").size().to_dict() == {"mine": 3, "MCR": 3}


def test_standings_are_the_means_of_the_whole_and_of_each_part() -> None:
    tables = {table.title: table for table in standings(rows())}
    assert list(tables) == [WHOLE.capitalize(), "BARN", "Movers"]
    found = numbers(rows(), "mine")
    assert found[WHOLE]["flights"] == 6
    assert found[WHOLE]["success"][0] == pytest.approx(100 * 4 / 6)
    assert found["BARN"]["success"][0] == pytest.approx(50.0)
    assert found["movers"]["compute_s"][0] == pytest.approx(2.0)
    assert numbers(rows(), "MCR")[WHOLE]["compute_s"][0] == pytest.approx(1.0)
    low, high = found[WHOLE]["success"][1:]
    assert low < found[WHOLE]["success"][0] < high


def test_a_table_in_which_only_some_scenes_have_a_truth_is_whole(tmp_path: Path) -> None:
    """BARN's worlds among others used to end the report: "the column barn_collided must hold numbers"."""
    file = tmp_path / "trials.parquet"
    words = ("trial", "status", "strategy", "world", "outcome")
    row = {name: 0 for name in FIRST} | dict.fromkeys(words, "a") | {"success": True}
    write_table(file, [row | {"barn_collided": True}, row | {"trial": "b"}])
    table = pd.read_parquet(file)
    assert table["barn_collided"].isna().sum() == 1
    check_table(file, table, {})
    with pytest.raises(RecordError, match="must hold numbers"):
        check_table(file, table.assign(barn_collided=["yes", None]), {})


def test_a_scene_that_only_one_has_flown_is_left_out() -> None:
    made = rows()
    mine, others = made[made["arm of all axes"] == "mine"], made[made["arm of all axes"] == "MCR"]
    there = in_common(mine[mine["scene"] != "BARN: 6"], others)
    assert set(there["scene"]) == {"BARN: 0", "movers: hall"}
    assert there.groupby("arm of all axes").size().to_dict() == {"mine": 4, "MCR": 4}


def test_compute_is_the_sum_of_what_the_plans_cost(tmp_path: Path) -> None:
    plans = {"wall_search_sum_s": 1.0, "wall_optimise_sum_s": 0.5, "wall_trigger_sum_s": 0.25}
    row = {"arm": "mine", "seed": 0, "success": True, "status": "ok", "trial": "a", "wall_trial_s": 9.0}
    made_up(tmp_path, pd.DataFrame([row | plans]), {"arm": ("mine",)})
    assert rows_of(tmp_path)["compute_s"].tolist() == [1.75]


@pytest.mark.parametrize("word", [
    "seed=0", "experiments=mcr/table1", "world=rooms", "world_seed=1", "movers=none", "mission=reach",
    "vehicle=point_mass", "sensor=lidar", "sensor.range_m=9", "estimator=perfect", "estimator.drift=0",
])  # fmt: skip
def test_what_is_the_suites_is_refused(word: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["trigger=mcr", word, "runner.dry_run=true"]) == 2
    assert "the suite's own, the same for every entry" in capsys.readouterr().err

"""The command line from outside: exit codes, one line for bad input, what a flight leaves behind."""

from __future__ import annotations

import json
import os
import shlex
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pandas as pd
import pytest

import uavexp
from uavexp.__main__ import main
from uavexp.errors import ConfigError
from uavexp.metrics.evaluate import evaluate
from uavexp.paths import PACKAGE, conf_folder
from uavexp.report.__main__ import main as report
from uavexp.show.__main__ import main as show
from uavexp.store.logs import read_log
from uavexp.store.records import read_record
from uavexp.store.table import FIRST

TINY = ("world=random_columns", "world.size_m=[8,6,3]")


def run(*typed: str, cwd: Path, **environment: str) -> subprocess.CompletedProcess[str]:
    variables = {**os.environ, "PYTHONPATH": str(PACKAGE.parent), **environment}
    return subprocess.run(
        [sys.executable, "-m", "uavexp", *typed],
        cwd=cwd,
        env=variables,
        capture_output=True,
        text=True,
        timeout=300,
    )


@pytest.fixture(autouse=True)
def somewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Every command runs in an empty folder."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("uavexp.store.folder.outputs_root", lambda: tmp_path / "outputs")
    return tmp_path


@pytest.fixture(scope="module")
def flown(
    tmp_path_factory: pytest.TempPathFactory,
) -> tuple[Path, subprocess.CompletedProcess[str]]:
    """Two strategies, two seeds, flown from another folder with a user's thread settings."""
    folder = tmp_path_factory.mktemp("flown")
    done = run(*TINY, "strategy=mcr,tbr", "seed=0:2", "out=mine", cwd=folder, OMP_NUM_THREADS="2")
    return folder / "mine", done


def test_a_command_that_flies_ends_with_its_folder(flown: tuple[Path, Any]) -> None:
    folder, done = flown
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    assert done.stdout.splitlines()[-2:] == [f"show:    python -m uavexp.show {folder}", str(folder)]
    assert {item.name for item in folder.iterdir()} == {
        ".lock", "study.json", "run.json", "trials.parquet", "replans.parquet", "trials", "worlds"
    }  # fmt: skip
    for trial in (folder / "trials").iterdir():
        assert {item.name for item in trial.iterdir()} == {
            "record.json", "log.npz", "wall.json"
        }  # fmt: skip
    assert len(list((folder / "worlds").iterdir())) == 2, "a world for each seed, shared by the strategies"


def test_flights_are_shown_as_the_command_said(flown: tuple[Path, Any], tmp_path: Path) -> None:
    assert show([str(flown[0]), "--out", str(tmp_path / "page.html")]) == 0
    page = (tmp_path / "page.html").read_text()
    assert '"label":"mcr"' in page
    assert '"label":"tbr"' in page
    assert '"grows":true' in page
    trial = next((flown[0] / "trials").iterdir())
    assert show([str(trial), "--out", str(tmp_path / "page.html")]) == 0
    assert f"seed {read_record(trial)['seed']}" in (tmp_path / "page.html").read_text()


def test_pictures_are_drawn_of_failures_of_single_flights_and_on_demand(
    flown: tuple[Path, Any], tmp_path: Path
) -> None:
    drawn = Path(shutil.copytree(flown[0], tmp_path / "drawn"))
    assert report([str(drawn), "--pictures"]) == 0
    on_demand = {file.parent.name: file.read_bytes() for file in drawn.glob("trials/*/picture.png")}
    assert on_demand.keys() == {item.name for item in (drawn / "trials").iterdir()}
    assert main([*TINY, "strategy=mcr", "seed=0", "out=alone"]) == 0
    (alone,) = Path("alone").glob("trials/*/picture.png")
    assert alone.read_bytes() == on_demand[alone.parent.name]
    assert (
        main([*TINY, "seed=0:2", "mission.time_base_s=0.5", "mission.time_per_path_spm=0", "out=late"]) == 0
    )
    assert len(list(Path("late").glob("trials/*/picture.png"))) == 2


def test_the_table_has_a_row_per_trial_sorted_by_cell_and_seed(flown: tuple[Path, Any]) -> None:
    table = pd.read_parquet(flown[0] / "trials.parquet")
    assert tuple(table.columns[: len(FIRST)]) == FIRST
    assert list(zip(table["strategy"], table["seed"], strict=True)) == [
        ("mcr", 0), ("mcr", 1), ("tbr", 0), ("tbr", 1)
    ]  # fmt: skip
    assert set(table["planner"]) == {"min_acc"}
    assert set(table["p_world_size_m"]) == {"[8.0,6.0,3.0]"}
    assert list(table["p_trigger_interval_s"].notna()) == [False, False, True, True]
    assert (table["wall_trial_s"] > 0).all()


def test_the_same_world_flies_under_every_strategy(flown: tuple[Path, Any]) -> None:
    worlds = {
        (record["seed"], record["world"]["digest"])
        for record in (read_record(item) for item in (flown[0] / "trials").iterdir())
    }
    assert len(worlds) == 2


def test_a_record_holds_no_clock_and_no_path(flown: tuple[Path, Any]) -> None:
    for item in (flown[0] / "trials").iterdir():
        text = (item / "record.json").read_text()
        assert "wall" not in text
        assert str(flown[0].parent) not in text
        assert str(Path.home()) not in text


def test_metrics_are_those_of_the_stored_log(flown: tuple[Path, Any]) -> None:
    folder = next(item for item in (flown[0] / "trials").iterdir() if item.name.startswith("mcr"))
    record = read_record(folder)
    trial = uavexp.fly(*TINY, seed=record["seed"])
    again = evaluate(read_log(folder / "log.npz"), trial.world)
    assert {key: repr(value) for key, value in again.items()} == {
        key: repr(value) for key, value in record["metrics"].items()
    }
    assert {key: repr(value) for key, value in trial.metrics.items()} == {
        key: repr(value) for key, value in record["metrics"].items()
    }


def test_the_printed_command_repeats_a_trial_byte_for_byte(flown: tuple[Path, Any], tmp_path: Path) -> None:
    folder = next(
        item for item in (flown[0] / "trials").iterdir() if "tbr" in item.name and "-s1-" in item.name
    )
    command = json.loads((folder / "wall.json").read_text())["command"]
    assert command in flown[1].stdout
    typed = shlex.split(command)[3:]
    done = run(*typed, "out=again", cwd=tmp_path, OMP_NUM_THREADS="1")
    assert done.returncode == 0, done.stderr
    for name in ("record.json", "log.npz"):
        assert (tmp_path / "again" / "trials" / folder.name / name).read_bytes() == (
            folder / name
        ).read_bytes()


def test_a_folder_that_holds_trials_is_left_alone(
    flown: tuple[Path, Any], capsys: pytest.CaptureFixture[str]
) -> None:
    before = {item: item.stat().st_mtime_ns for item in flown[0].rglob("*") if item.name != ".lock"}
    assert main([*TINY, "latency_s=0.05", f"out={flown[0]}"]) == 2
    assert "holds the trials of an earlier command" in capsys.readouterr().err
    after = {item: item.stat().st_mtime_ns for item in flown[0].rglob("*") if item.name != ".lock"}
    assert after == before


BAD = [
    ["strategy=mrc"],
    ["nonsense"],
    ["--nonsense"],
    ["strategy=mcr", "strategy=tbr"],
    ["trigger.delta_mapm=1"],
    ["sensor.rate_hz=fast"],
    ["sensor.rate_hz=nan"],
    ["sensor.rate_hz=30"],
    ["latency_s=0.025"],
    ["seed=1,1"],
    ["seed=3:3"],
    ["seed=range(3,0)"],
    ["seed=-1"],
    ["world=file"],
    ["world=file", "world.path=missing.ply"],
    ["world=file", "world.path=."],
    ["world=file", "world.path=hall (2).ply"],
    ["experiments=mcr/tabel1"],
    ["-m", "strategy=mcr,tbr", "trigger.interval_s=1,2"],
    ["+hydra.callbacks.x._target_=os.system"],
    ["hydra.searchpath=[pkg://this]"],
    ["planner._target_=os.system"],
    ["++world.x={_target_: os.system}"],
    ["--config-dir", "nowhere"],
    ["--cfg", "nonsense"],
    ["--help", "--nonsense"],
    ["--help", "nope"],
    ["out=afile/inside"],
    ["out=afile"],
    ["out="],
    ["world.size_m=[1e6,1e6,3]"],
]


@pytest.mark.parametrize("typed", BAD, ids=" ".join)
def test_bad_input_is_one_line_exit_code_2_and_nothing_written(
    typed: list[str], somewhere: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (somewhere / "afile").write_text("mine")
    out = [] if any(word.startswith("out=") for word in typed) else ["out=new/deep"]
    assert main([*typed, *out]) == 2
    printed = capsys.readouterr()
    assert printed.err.count("\n") == 1, printed.err
    assert printed.err.startswith("error: ")
    assert len(printed.err) < 700
    assert "Traceback" not in printed.err
    assert printed.out == ""
    assert [item.name for item in somewhere.iterdir()] == ["afile"]
    assert (somewhere / "afile").read_text() == "mine"


def test_bad_input_from_a_shell(somewhere: Path) -> None:
    done = run("strategy=mrc", "out=new", cwd=somewhere)
    assert done.returncode == 2
    assert done.stdout == ""
    assert done.stderr.count("\n") == 1
    assert "did you mean 'mcr'" in done.stderr
    assert not list(somewhere.iterdir())


def test_empty_and_truncated_files_are_told_before_anything_is_written(
    somewhere: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for name in ("empty.ply", "text.obj", "cut.glb"):
        (somewhere / name).write_bytes(b"" if "empty" in name else b"not a mesh at all\n")
        assert main(["world=file", f"world.path={name}", "out=new"]) == 2
        error = capsys.readouterr().err
        assert error.count("\n") == 1
        assert name in error
        assert not (somewhere / "new").exists()


def test_help_is_text_from_the_yaml_files_and_loads_nothing_heavy(somewhere: Path) -> None:
    code = (
        "import sys; from uavexp.__main__ import main; assert main(['--help']) == 0; "
        "heavy = {'numpy', 'numba', 'hydra', 'omegaconf', 'open3d', 'casadi', 'scipy'} & set(sys.modules); "
        "assert not heavy, heavy"
    )
    variables = {**os.environ, "PYTHONPATH": str(PACKAGE.parent)}
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=somewhere, env=variables, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    for words in (
        "*warehouse",
        "trigger.delta_map_m",
        "0.15",
        "m, ",
        "seed=range",
        "UAVEXP_TRUST",
        "exit code",
    ):
        assert words in done.stdout


def test_help_tells_of_every_parameter_of_every_option(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--help"]) == 0
    text = capsys.readouterr().out
    for file in conf_folder().glob("*/*.yaml"):
        assert file.stem in text
        if file.parent.name != "strategy":
            for line in file.read_text().splitlines():
                name = line.partition(":")[0]
                if name.isidentifier() and name not in ("_target_", "defaults"):
                    assert f"{file.parent.name}.{name} " in text


def test_help_of_one_group_is_that_group(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--help", "trigger"]) == 0
    text = capsys.readouterr().out
    assert "trigger.delta_map_m" in text
    assert "world." not in text


def test_cfg_job_prints_what_would_fly_and_flies_nothing(
    somewhere: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["--cfg", "job", "strategy=tbr", "trigger.interval_s=2", "seed=1:3"]) == 0
    text = capsys.readouterr().out
    assert "interval_s: 2.0" in text
    assert "_target_: uavexp.trigger.tbr.Tbr" in text
    assert not list(somewhere.iterdir())


def test_an_installed_package_finds_its_configuration_inside_itself(tmp_path: Path) -> None:
    installed = tmp_path / "site" / "uavexp"
    shutil.copytree(PACKAGE, installed, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copytree(conf_folder(), installed / "conf")
    variables = {**os.environ, "PYTHONPATH": str(installed.parent)}
    command = [sys.executable, "-m", "uavexp", "--info"]
    done = subprocess.run(command, cwd=tmp_path, env=variables, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert str(installed / "conf") in done.stdout
    assert str(tmp_path / "outputs") in done.stdout


FAULTY = ("--config-dir", str(PACKAGE.parent / "tests" / "faulty"), *TINY, "trigger=faulty", "seed=0")


def test_a_trial_that_raises_leaves_a_record(somewhere: Path) -> None:
    done = run(*FAULTY, "trigger.deed=raise", "out=run", cwd=somewhere, UAVEXP_TRUST="tests")
    assert done.returncode == 1, done.stderr
    assert "ZeroDivisionError: no such luck" in done.stdout
    table = pd.read_parquet(somewhere / "run" / "trials.parquet")
    assert list(table["outcome"]) == ["error"]
    assert list(table["success"]) == [False]
    assert list(table["status"]) == ["raised"]
    record = read_record(somewhere / "run" / "trials" / table["trial"][0])
    assert record["outcome"] == "error"
    assert record["reason"] == "ZeroDivisionError: no such luck"
    assert any("fly_cell" in line for line in record["traceback"])
    assert not any(str(PACKAGE) in line for line in record["traceback"])


def test_bad_input_that_shows_only_in_flight_is_still_bad_input(somewhere: Path) -> None:
    done = run(*FAULTY, "trigger.deed=raise_bad_input", "out=run", cwd=somewhere, UAVEXP_TRUST="tests")
    assert done.returncode == 2
    assert done.stderr == "error: no such device\n"
    assert not list(somewhere.iterdir())


def test_new_folders_are_numbered_and_hold_no_clock(somewhere: Path) -> None:
    for _ in range(2):
        assert main([*TINY, "seed=0", "mission.time_base_s=1.0", "mission.time_per_path_spm=0.2"]) == 0
    names = sorted(item.name for item in (somewhere / "outputs").iterdir())
    assert names == ["0001-mcr-random_columns", "0002-mcr-random_columns"]


def test_a_notebook_flies_one_trial_and_writes_nothing(somewhere: Path) -> None:
    trial = uavexp.fly("world=random_columns", strategy="mcr", seed=0, **{"world.size_m": [8, 6, 3]})
    assert trial.metrics["outcome"] == trial.log.outcome == "reached"
    assert trial.seed == 0
    assert trial.config["world"]["size_m"] == [8.0, 6.0, 3.0]
    assert "seed=0" in trial.command
    assert not list(somewhere.iterdir())
    with pytest.raises(ConfigError, match="one trial"):
        uavexp.fly(*TINY, seed="0:2")


def test_threads_are_pinned_whatever_the_user_set(somewhere: Path) -> None:
    code = "import uavexp, os; print(os.environ['OMP_NUM_THREADS'], os.environ['OPENBLAS_NUM_THREADS'])"
    variables = {**os.environ, "PYTHONPATH": str(PACKAGE.parent), "OMP_NUM_THREADS": "2"}
    done = subprocess.run(
        [sys.executable, "-c", code], env=variables, capture_output=True, text=True, check=True
    )
    assert done.stdout.split() == ["1", "1"]

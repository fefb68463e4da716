"""Sweeps as a user types them, and everything that may befall one."""

from __future__ import annotations

import contextlib
import json
import random
import shutil
import signal
import subprocess
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pandas as pd
import pytest

import uavexp
from tests.sweeps import QUICK, assert_same_study, begin, records, run
from uavexp.__main__ import main
from uavexp.config.composition import Composer
from uavexp.config.overrides import parse_settings
from uavexp.paths import PACKAGE
from uavexp.store.history import commit
from uavexp.store.records import Status, canonical_json, digest, read_record, seal
from uavexp.store.study import collect, read_runs, read_study
from uavexp.sweep.agenda import agenda_of
from uavexp.sweep.fork_server import start_fork_server
from uavexp.sweep.head_start import PRELOAD
from uavexp.sweep.job import Allowance
from uavexp.sweep.local import run_local
from uavexp.sweep.trial_job import fly_job

STUDY = (*QUICK, "strategy=mcr,tbr", "seed=0:3")
FAULTY = ("--config-dir", str(PACKAGE.parent / "tests" / "faulty"))
TRUST = {"UAVEXP_TRUST": "tests"}


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The study, flown by two workers and left alone."""
    folder = tmp_path_factory.mktemp("undisturbed") / "study"
    assert main([*STUDY, "runner.n_jobs=2", f"out={folder}"]) == 0
    return folder


@pytest.fixture
def copy(undisturbed: Path, tmp_path: Path) -> Path:
    """The same study, to be damaged."""
    return Path(shutil.copytree(undisturbed, tmp_path / "study"))


def test_one_worker_leaves_what_two_leave(
    undisturbed: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([*STUDY, "runner.n_jobs=1", f"out={tmp_path / 'one'}"]) == 0
    assert capsys.readouterr().out.splitlines()[-1] == str(tmp_path / "one")
    assert_same_study(tmp_path / "one", undisturbed)


def test_a_sweep_killed_at_ten_random_moments_ends_as_if_it_had_not_been(
    undisturbed: Path, tmp_path: Path
) -> None:
    folder, chance = tmp_path / "killed", random.Random(7)
    kept: dict[str, bytes] = {}
    for _ in range(10):
        process = begin(*STUDY, "runner.n_jobs=2", f"out={folder}")
        assert process.stdout is not None
        process.stdout.readline()  # "flying ..."
        if chance.random() < 0.3:
            process.stdout.readline()  # a trial has ended, another line has come
        time.sleep(chance.uniform(0.0, 1.0))
        process.kill()
        process.communicate()
        now = records(folder)
        assert kept.items() <= now.items(), "a recorded trial was lost or changed"
        kept = now
    done = run(*STUDY, "runner.n_jobs=2", f"out={folder}")
    assert done.returncode == 0, done.stderr
    assert_same_study(folder, undisturbed)
    assert not list(folder.rglob("*.part"))
    assert not list(folder.rglob("*.aside-*"))


def test_the_same_command_again_flies_nothing_and_changes_nothing(
    copy: Path, undisturbed: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([*STUDY, f"out={copy}"]) == 0
    assert "nothing is left to fly; 6 trials finished before" in capsys.readouterr().out
    assert_same_study(copy, undisturbed)


def test_more_seeds_and_strategies_extend_a_study(
    undisturbed: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "grown"
    assert main([*QUICK, "strategy=tbr", "seed=0:2", f"out={folder}"]) == 0
    assert main([*STUDY, f"out={folder}"]) == 0
    assert "flying 4 trials; 2 trials finished before" in capsys.readouterr().out
    assert_same_study(folder, undisturbed)


def test_damaged_trials_are_found_named_set_aside_and_flown_again(
    copy: Path, undisturbed: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    cut, flipped, unlogged, *_ = sorted((copy / "trials").iterdir())
    (cut / "record.json").write_bytes((cut / "record.json").read_bytes()[:500])
    for file in (flipped / "record.json", unlogged / "log.npz"):
        data = bytearray(file.read_bytes())
        data[len(data) // 2] ^= 1
        file.write_bytes(data)
    assert main([*STUDY, f"out={copy}"]) == 0
    out = capsys.readouterr().out
    for trial in (cut, flipped, unlogged):
        assert f"damaged, set aside: {trial.name}" in out
        assert trial.with_name(f"{trial.name}.aside-1").is_dir()
    assert "flying 3 trials; 3 trials finished before" in out
    for aside in (copy / "trials").glob("*.aside-1"):
        shutil.rmtree(aside)
    assert_same_study(copy, undisturbed)


@pytest.mark.parametrize("key", ["code", "lock"])
def test_trials_of_another_version_are_not_pooled_unasked(
    copy: Path, key: str, capsys: pytest.CaptureFixture[str]
) -> None:
    trial = min((copy / "trials").iterdir())
    (trial / "record.json").write_text(seal({**read_record(trial), key: "0" * 64}))
    before = records(copy)
    assert main([*STUDY, f"out={copy}"]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert "holds 1 trials flown by another version" in error
    assert "runner.accept_other_code=true" in error
    assert records(copy) == before
    if key == "code":
        assert main([*STUDY, f"out={copy}", "runner.accept_other_code=true"]) == 0
        assert "Trials of 2 versions" in capsys.readouterr().out
        assert set(pd.read_parquet(copy / "trials.parquet")["code"].str.startswith("000000")) == {True, False}


def test_a_world_that_is_cut_or_gone_is_mended_when_a_trial_in_it_flies_again(
    copy: Path, undisturbed: Path
) -> None:
    cut, gone, _ = sorted((copy / "worlds").iterdir())
    cut.write_bytes(cut.read_bytes()[:1000])
    gone.unlink()
    for row in read_study(copy).trials.to_dict("records"):
        if row["world_digest"] in (cut.stem, gone.stem) and row["strategy"] == "tbr":
            shutil.rmtree(copy / "trials" / row["trial"])
    assert main([*STUDY, f"out={copy}"]) == 0
    assert_same_study(copy, undisturbed)


def test_parts_of_one_experiment_join_in_any_order(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Used to be refused unless one command had all cells of the other."""
    file = tmp_path / "own" / "experiments" / "mine" / "parts.yaml"
    file.parent.mkdir(parents=True)
    file.write_text("axes: {arm: {MCR: {strategy: mcr}, TBR: {strategy: tbr}, SSP: {strategy: ssp}}}")
    given = ("--config-dir", str(tmp_path / "own"), *QUICK, "experiments=mine/parts", "seed=0")
    assert main([*given, "arm=MCR,TBR", f"out={tmp_path / 'whole'}"]) == 0
    for arm in ("TBR", "MCR"):
        assert main([*given, f"arm={arm}", f"out={tmp_path / 'parts'}"]) == 0
    assert_same_study(tmp_path / "parts", tmp_path / "whole")
    capsys.readouterr()
    assert main([*given, "arm=SSP", "latency_s=0.05", f"out={tmp_path / 'parts'}"]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert "out=DIR" in error
    assert "experiments=mine/parts seed=0 arm=MCR)" in error  # the earlier command, as typed


def test_one_trial_keeps_the_limits_of_all_trials(tmp_path: Path) -> None:
    """Used to be flown in the command's own process, without any."""
    assert main([*QUICK, "seed=0", "runner.timeout_s=0.01", f"out={tmp_path / 'study'}"]) == 1
    (row,) = read_study(tmp_path / "study").trials.to_dict("records")
    assert row["status"] == "hung"


def test_trials_of_another_schema_are_refused_with_what_to_do(
    copy: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    trial = min((copy / "trials").iterdir())
    body = {**json.loads((trial / "record.json").read_text()), "schema": 1}
    body.pop("sha256")
    (trial / "record.json").write_text(canonical_json({**body, "sha256": digest(body)}))
    assert main([*STUDY, f"out={copy}", "runner.accept_other_code=true"]) == 2
    error = capsys.readouterr().err
    assert "schema 1" in error
    assert "out=DIR" in error
    assert error.count("\n") == 1


def test_a_dry_run_lists_what_is_left_and_writes_nothing(
    copy: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    missing = min((copy / "trials").iterdir())
    shutil.rmtree(missing)
    before = {item: item.stat().st_mtime_ns for item in copy.rglob("*")}
    assert main([*STUDY, f"out={copy}", "runner.dry_run=true"]) == 0
    out = capsys.readouterr().out
    assert "to fly 1 trial; 5 trials finished before" in out
    assert [line.split()[0] for line in out.splitlines() if "-s0-" in line] == [missing.name]
    assert {item: item.stat().st_mtime_ns for item in copy.rglob("*")} == before


def test_a_second_sweep_on_a_folder_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    long = (*QUICK, "strategy=mcr,tbr", "seed=0:300")  # it flies on until it is stopped
    first = begin(*long, "runner.n_jobs=1", f"out={tmp_path / 'shared'}")
    assert first.stdout is not None
    first.stdout.readline()
    assert main([*long, f"out={tmp_path / 'shared'}"]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert f"another command (process {first.pid}) is flying into it" in error
    first.terminate()
    told, error = first.communicate()
    assert first.returncode == 130, told + error


def test_a_study_in_which_nobody_asked_for_a_plan_can_be_read(tmp_path: Path) -> None:
    assert (
        main([*QUICK, "strategy=mcr", "seed=0:2", "mission.tolerance_m=1000", f"out={tmp_path / 'there'}"])
        == 0
    )
    assert len(uavexp.read_study(tmp_path / "there").replans) == 0


def test_a_trial_that_fails_costs_itself_alone_and_is_flown_again(tmp_path: Path) -> None:
    folder = tmp_path / "study"
    deeds = "trigger.deed=raise,segfault,kill,hog,sleep,print"
    typed = (*FAULTY, *QUICK, "trigger=faulty", deeds, "seed=0", f"out={folder}")
    runner = ("runner.timeout_s=20", "runner.memory_mb=1500")
    done = run(*typed, *runner, **TRUST)
    assert done.returncode == 1
    assert done.stderr == ""
    assert "trigger.deed=raise seed 0 raised: ZeroDivisionError" in done.stdout
    assert "  in tests/jobs.py:" in done.stdout, "its last frame"
    trials = pd.read_parquet(folder / "trials.parquet").set_index("p_trigger_deed")
    assert trials["status"].to_dict() == {
        "raise": "raised", "segfault": "killed", "kill": "killed",
        "hog": "memory", "sleep": "hung", "print": "ok"
    }  # fmt: skip
    assert set(trials["outcome"][trials["status"] != "ok"]) == {"error"}
    assert not trials["success"][trials["status"] != "ok"].any()
    record = read_record(folder / "trials" / trials["trial"]["segfault"])
    assert "SIGSEGV" in record["reason"]
    assert any("faulty/policy.py" in frame for frame in record["traceback"])
    assert str(PACKAGE.parent) not in json.dumps(record)
    again = run(
        *FAULTY, *QUICK, "trigger=faulty", "trigger.deed=raise,print", "seed=0", f"out={folder}", **TRUST
    )
    assert "flying 1 trial; 1 trial finished before; 1 trial failed before" in again.stdout, again.stderr
    assert len(list((folder / "trials").glob("*.aside-1"))) == 1
    assert len(pd.read_parquet(folder / "trials.parquet")) == 6


def test_an_interrupted_sweep_says_how_to_go_on(tmp_path: Path) -> None:
    folder = tmp_path / "study"
    process = begin(*STUDY, "runner.n_jobs=1", f"out={folder}")
    assert process.stdout is not None
    while not process.stdout.readline().startswith("[2/6]"):
        assert process.poll() is None
    process.send_signal(signal.SIGINT)
    out, error = process.communicate(timeout=120)
    assert process.returncode == 130
    assert error == "interrupted\n"
    assert f"of 6 trials are kept in {folder}; the same command flies the others" in out
    assert len(pd.read_parquet(folder / "trials.parquet")) == len(records(folder)) >= 2
    (entry,) = read_runs(folder)
    assert (entry["ended"], entry["flown"]) == ("interrupted", len(records(folder)))
    assert main([*STUDY, f"out={folder}"]) == 0
    assert [entry["ended"] for entry in read_runs(folder)] == ["interrupted", "finished"]
    assert {entry["commit"] for entry in read_runs(folder)} == {commit()}


def test_a_child_that_has_flown_leaves_the_bytes_of_a_fresh_one(tmp_path: Path) -> None:
    """What a process keeps from one flight to the next must show in none; last comes the first again."""
    others = (
        "strategy=tbr mapping=voxel_block_grid", "strategy=mcr_literal planner=bspline_mpc",
        "planner=df_bitstar sensor=lidar_rosette", "movers=mixed movers.count=3 detection=noisy",
        "planner=rrtstar estimator=drift safety=brake",
    )  # fmt: skip
    commands = [Composer().command(parse_settings([*QUICK, *typed.split(), "seed=0"])) for typed in others]
    first, *rest = [agenda_of(command, tmp_path).jobs[0] for command in commands]
    given = [first, *rest, replace(first, name="again")]
    start_fork_server([PRELOAD])
    limits = Allowance(timeout_s=300.0, memory_mb=4000.0)
    reused = list(run_local(fly_job, given, n_jobs=1, limits=limits))
    fresh = [next(run_local(fly_job, [job], n_jobs=1, limits=limits)) for job in given[:-1]]
    for ours, theirs in zip(reused, [*fresh, fresh[0]], strict=True):
        assert ours.answer.status is Status.OK, ours.answer.reason
        assert ours.answer.value.world == theirs.answer.value.world
        files = [{**done.answer.value.files, "wall.json": b""} for done in (ours, theirs)]
        assert files[0] == files[1], ours.job.payload.command


@contextlib.contextmanager
def small_disk(place: Path, size: str) -> Iterator[None]:
    place.mkdir()
    made = subprocess.run(
        ["mount", "-t", "tmpfs", "-o", f"size={size}", "none", str(place)], capture_output=True, text=True
    )
    if made.returncode != 0:
        pytest.skip(f"no small disk may be mounted here: {made.stderr.strip()}")
    try:
        yield
    finally:
        subprocess.run(["umount", "-l", str(place)], check=True)


def test_a_full_disk_ends_the_sweep_with_one_line_and_loses_nothing(
    undisturbed: Path, tmp_path: Path
) -> None:
    disk = tmp_path / "disk"
    with small_disk(disk, "700k"):
        done = run(*STUDY, "runner.n_jobs=2", f"out={disk / 'study'}")
        assert done.returncode == 1, "what was typed was right"
        assert done.stderr.count("\n") == 1
        assert "No space left on device" in done.stderr
        kept = records(disk / "study")
        assert 0 < len(kept) < 6
        assert kept.items() <= records(undisturbed).items()
        assert not list((disk / "study").rglob("*.part"))
        subprocess.run(["mount", "-o", "remount,size=20m", str(disk)], check=True)
        assert main([*STUDY, f"out={disk / 'study'}"]) == 0
        assert_same_study(disk / "study", undisturbed)


def test_the_tables_can_be_made_again_from_the_records(copy: Path) -> None:
    tables = [copy / "trials.parquet", copy / "replans.parquet"]
    before = [file.read_bytes() for file in tables]
    for file in tables:
        file.unlink()
    rows = collect(copy)
    assert [file.read_bytes() for file in tables] == before
    assert [(row["cell"], row["seed"]) for row in rows] == [
        (cell, seed) for cell in ("mcr", "tbr") for seed in range(3)
    ]


def test_a_study_reads_its_logs_and_worlds_back(undisturbed: Path) -> None:
    study = read_study(undisturbed)
    assert study.axes == {"cell": ("mcr", "tbr")}
    assert study.seeds == (0, 1, 2)
    row = study.trials.iloc[0]
    world = study.world(row["world_digest"])
    assert world.digest == row["world_digest"]
    log = study.log(row["trial"])
    assert log.steps.position_m[0] == pytest.approx(world.start_m)
    requests = study.replans[study.replans["trial"] == row["trial"]]
    assert list(requests["number"]) == list(range(len(log.replans)))
    assert list(requests["near_change"]) == [item.near_change for item in log.replans]

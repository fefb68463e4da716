"""The page of a running study: what it says is what lies in the folder, which it only reads."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import urllib.error
import urllib.request
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest

from tests.sweeps import QUICK
from uavexp.__main__ import main
from uavexp.report.__main__ import main as report
from uavexp.report.watch import View
from uavexp.store.history import FLYING
from uavexp.store.study import TRIALS, trial_folders


@pytest.fixture(scope="module")
def six(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A study of six short flights."""
    folder = tmp_path_factory.mktemp("six") / "study"
    assert main([*QUICK, "strategy=mcr,tbr", "seed=0:3", "runner.n_jobs=1", f"out={folder}"]) in (0, 1)
    return folder


@pytest.fixture
def running(six: Path, tmp_path: Path) -> Path:
    """The study when three of its six trials had flown, in one minute."""
    folder = tmp_path / "running"
    shutil.copytree(six, folder)
    for trial in list(trial_folders(folder))[3:]:
        shutil.move(trial, tmp_path / trial.name)
    for name in ("trials.parquet", "replans.parquet"):
        (folder / name).unlink()
    began = (datetime.now(UTC) - timedelta(minutes=1)).isoformat()
    run = {"command": ["strategy=mcr,tbr"], "began": began, "ended": FLYING}
    (folder / "run.json").write_text(json.dumps({"runs": [run]}))
    for record in (folder / TRIALS).glob("*/record.json"):
        os.utime(record)
    return folder


def view_of(folder: Path, tmp_path: Path) -> View:
    (tmp_path / "shadow").mkdir()
    return View(folder=folder, shadow=tmp_path / "shadow")


def test_progress_and_pace_are_those_of_the_records(running: Path, tmp_path: Path) -> None:
    page = view_of(running, tmp_path).page()
    assert "3 of 6 trials" in page
    assert "3.0 a minute; about 1 min are left" in page
    assert "Tables so far" in page


def test_what_flies_on_is_shown_and_the_folder_is_only_read(running: Path, tmp_path: Path) -> None:
    view = view_of(running, tmp_path)
    before = sorted(running.rglob("*"))
    view.page()
    assert sorted(running.rglob("*")) == before
    later = next(tmp_path.glob("*-s[0-9]*"))
    shutil.move(later, running / TRIALS / later.name)
    view._next_s = 0.0  # as if time had passed
    assert "4 of 6 trials" in view.page()


def test_a_study_without_a_trial_yet_says_so(running: Path, tmp_path: Path) -> None:
    shutil.rmtree(running / TRIALS)
    page = view_of(running, tmp_path).page()
    assert "0 of 6 trials" in page
    assert "The first trials are being flown" in page


def test_an_ended_command_says_how(running: Path, tmp_path: Path) -> None:
    (running / "run.json").write_text(json.dumps({"runs": [{"command": [], "ended": "interrupted"}]}))
    assert "The command has ended: interrupted." in view_of(running, tmp_path).page()


def test_nothing_but_pictures_of_trials_is_handed_out(running: Path, tmp_path: Path) -> None:
    view = view_of(running, tmp_path)
    trial = next(trial_folders(running))
    (trial / "picture.png").write_bytes(b"png")
    assert view.picture(f"/trials/{trial.name}/picture.png") == b"png"
    for address in (
        "/run.json",
        "/trials/../run.json",
        f"/trials/{trial.name}/record.json",
        "/../picture.png",
    ):
        assert view.picture(address) is None


def test_the_command_serves_the_page_until_it_is_interrupted(running: Path) -> None:
    command = [sys.executable, "-m", "uavexp.report", str(running), "--watch"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        address = process.stdout.readline().split(" at ")[1].split()[0]
        with urllib.request.urlopen(address, timeout=60.0) as answer:
            assert "3 of 6 trials" in answer.read().decode()
        with pytest.raises(urllib.error.HTTPError):
            urllib.request.urlopen(address + "run.json", timeout=60.0)
        process.send_signal(signal.SIGINT)
        try:
            assert process.wait(timeout=30.0) == 0
        finally:
            process.kill()


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["nowhere", "--watch"], "nowhere holds no study"),
        (["one", "two", "--watch"], "--watch shows one folder"),
        (["one", "--watch", "--port=x"], "--port=N takes a number"),
        (["one", "--wath"], "no such flag: --wath; there are --pictures, --watch and --port=N"),
    ],
)
def test_bad_input_is_one_line(words: list[str], told: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert report(words) == 2
    error = capsys.readouterr().err
    assert told in error
    assert error.count("\n") == 1

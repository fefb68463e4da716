"""What a system refuses ends in one line and exit 1; what was kept before stays, and is not flown again."""

from __future__ import annotations

import contextlib
import errno
import fcntl
import os
import resource
import shutil
import subprocess
import sys
import time
from multiprocessing import forkserver
from pathlib import Path

import pytest

from tests.jobs import act
from tests.sweeps import QUICK, begin, records, variables
from uavexp.__main__ import main
from uavexp.store.records import read_record
from uavexp.store.study import trial_folders
from uavexp.sweep.fork_server import RefusedError, kill_fork_server, start_fork_server
from uavexp.sweep.job import Allowance, Job
from uavexp.sweep.local import run_local

STUDY = (*QUICK, "strategy=mcr,tbr", "seed=0:20")


def limited(prefix: list[str], *typed: str, files: int | None = None) -> subprocess.CompletedProcess[str]:
    """A command under a limit of the system."""

    def limit() -> None:
        if files is not None:
            resource.setrlimit(resource.RLIMIT_NOFILE, (files, files))

    command = [*prefix, sys.executable, "-m", "uavexp", *typed]
    more = {"OMP_NUM_THREADS": "1"}  # others at import: numpy ends without a thread
    return subprocess.run(
        command, env=variables(**more), preexec_fn=limit, capture_output=True, text=True, timeout=120
    )


@pytest.mark.parametrize(("files", "words"), [(20, "files may be open"), (64, "no process can be started")])
def test_too_few_open_files(files: int, words: str, tmp_path: Path) -> None:
    done = limited([], *STUDY, "runner.n_jobs=40", f"out={tmp_path / 'out'}", files=files)
    assert (done.returncode, done.stderr.count("\n")) == (1, 1), done.stderr
    assert words in done.stderr
    assert not (tmp_path / "out").exists()


def test_a_fork_server_out_of_files_is_a_refusal() -> None:
    """Children that it had started were told as trials that ended with exit code 255, worlds as bad input."""
    start_fork_server(["tests.jobs"])
    server = forkserver._forkserver._forkserver_pid  # type: ignore[attr-defined]
    given = [Job(name=deed, label=deed, payload=(deed, 1.0)) for deed in ("sleep", "raise", "nothing")]
    limits = Allowance(timeout_s=60.0, memory_mb=1000.0)
    done = run_local(act, given, n_jobs=2, limits=limits, watch=lambda *told: limit_files(server))
    try:
        with pytest.raises(RefusedError, match="no process can be started for a trial"):
            list(done)
    finally:
        kill_fork_server()


def limit_files(process: int) -> None:
    """Let a process open no file beyond those that it has."""
    with contextlib.suppress(ProcessLookupError):
        resource.prlimit(process, resource.RLIMIT_NOFILE, (1, 1))


@pytest.mark.skipif(os.geteuid() != 0 or not shutil.which("setpriv"), reason="becomes another user")
@pytest.mark.parametrize("processes", [2, 12])
def test_no_more_processes_or_threads(processes: int, tmp_path: Path) -> None:
    """A fork server that could not fork wrote a traceback over the line."""
    tmp_path.chmod(0o777)
    capabilities = [f"--{kind}=-all,+dac_override" for kind in ("inh-caps", "ambient-caps", "bounding-set")]
    user = str(61000 + processes)  # who has no other process
    prefix = ["setpriv", f"--reuid={user}", "--clear-groups", *capabilities]
    prefix += ["prlimit", f"--nproc={processes}", "--"]
    done = limited(prefix, *STUDY, "runner.n_jobs=2", f"out={tmp_path / 'out'}")
    assert (done.returncode, done.stderr.count("\n")) == (1, 1), done.stderr
    assert "no process can be started for a trial" in done.stderr
    assert not records(tmp_path / "out")


@pytest.mark.parametrize("number", [errno.ENOLCK, errno.EOPNOTSUPP])
def test_a_file_system_without_locks(
    number: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def flock(file: object, operation: int) -> None:
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr(fcntl, "flock", flock)
    assert main([*QUICK, "seed=0", f"out={tmp_path / 'out'}"]) == 1
    error = capsys.readouterr().err
    assert "cannot lock a file" in error
    assert "out=DIR" in error
    assert error.count("\n") == 1
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("deed", ["deleted", "moved"])
def test_an_output_folder_that_goes_in_mid_flight(deed: str, tmp_path: Path) -> None:
    """It was made anew, with a trial and without a study."""
    out, elsewhere = tmp_path / "out", tmp_path / "elsewhere"
    process = begin(*STUDY, "runner.n_jobs=1", f"out={out}")
    while not records(out):
        assert process.poll() is None
        time.sleep(0.02)
    if deed == "deleted":
        while out.exists():
            shutil.rmtree(out, ignore_errors=True)
    else:
        out.rename(elsewhere)
    told, error = process.communicate(timeout=120)
    assert (process.returncode, error.count("\n")) == (1, 1), error
    assert "was deleted or moved" in error
    assert "are kept in" not in told
    assert not out.exists()
    if deed == "moved":
        assert len([read_record(trial) for trial in trial_folders(elsewhere)]) >= 1


def test_a_lock_that_is_a_link_or_a_pipe_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A stranger's folder had the number of the process written into a file of one's own."""
    mine, out = tmp_path / "mine", tmp_path / "out"
    mine.write_text("precious")
    out.mkdir()
    for make in (lambda file: file.symlink_to(mine), os.mkfifo):
        make(out / ".lock")
        assert main([*QUICK, "seed=0", f"out={out}"]) == 2
        assert capsys.readouterr().err.count("\n") == 1
        (out / ".lock").unlink()
    assert mine.read_text() == "precious"

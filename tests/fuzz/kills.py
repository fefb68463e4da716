"""Sweeps killed at random moments, one process or another: no record is lost, none is there twice."""

from __future__ import annotations

import contextlib
import os
import random
import signal
import subprocess
import time
from pathlib import Path

from tests.sweeps import QUICK, assert_same_study, begin, records, run

STUDY = (*QUICK, "strategy=mcr,tbr", "seed=0:4", "world_seed=0")
LOCAL = ("supervisor", "child", "fork server")
DASK = ("worker", "scheduler")
_LATEST_S = 6.0  # after the first sign of life
_MOST_RUNS = 40  # until a study is whole


def study(folder: Path) -> Path:
    """The study, flown without disturbance."""
    done = run(*STUDY, "runner.n_jobs=2", f"out={folder}")
    assert done.returncode == 0, done.stderr
    return folder


def faults_of(undisturbed: Path, place: Path, seed: int, kills: int) -> list[str]:
    """Kill a study so often, let it end, and compare; what was lost, twice or different."""
    chance = random.Random(seed)
    n_jobs, victims = chance.choice((1, 2)), LOCAL if seed % 4 else DASK
    how = ["runner=dask"] if victims == DASK else []
    typed = (*STUDY, *how, f"runner.n_jobs={n_jobs}", f"out={place}")
    kept: dict[str, bytes] = {}
    try:
        for _ in range(kills):
            _kill_one(typed, chance.choice(victims), chance)
            now = records(place)
            assert {name for name, data in kept.items() if b'"status":"ok"' in data} <= now.keys(), (
                "a record is lost"
            )
            kept = now
        for _ in range(_MOST_RUNS):
            if run(*STUDY, f"out={place}").returncode == 0:
                break
        assert_same_study(place, undisturbed)
    except AssertionError as error:
        return [f"seed {seed}, n_jobs={n_jobs}, {victims}: {str(error)[:500]}"]
    return []


def _kill_one(typed: tuple[str, ...], victim: str, chance: random.Random) -> None:
    process = begin(*typed)
    assert process.stdout is not None
    process.stdout.readline()  # "flying ..."
    time.sleep(chance.uniform(0.0, _LATEST_S))
    itself = victim in ("supervisor", "scheduler")
    with contextlib.suppress(ProcessLookupError, IndexError):  # it has ended meanwhile
        os.kill(process.pid if itself else _victim(process.pid, victim, chance), signal.SIGKILL)
    try:
        _, error = process.communicate(timeout=120)
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        raise AssertionError(f"hangs after the {victim} was killed") from None
    assert "Traceback" not in error, error
    assert itself or error.count("\n") <= 1, error  # of one that was killed its helpers may tell


def _victim(supervisor: int, victim: str, chance: random.Random) -> int:
    servers = [pid for pid in _below(supervisor) if "forkserver" in _command(pid)]
    workers = [pid for pid in _below(supervisor) if "spawn_main" in _command(pid)]
    if victim == "worker":
        return chance.choice(workers)
    return servers[0] if victim == "fork server" else chance.choice(_below(servers[0]))


def _below(pid: int) -> list[int]:
    tasks = Path(f"/proc/{pid}/task").glob("*/children")
    return [int(child) for task in tasks for child in task.read_text().split()]


def _command(pid: int) -> str:
    with contextlib.suppress(OSError):
        return Path(f"/proc/{pid}/cmdline").read_text()
    return ""

"""A sweep's children: each way a job can end costs that job alone, and none outlives the sweep."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest

from tests.jobs import act
from uavexp.errors import ConfigError
from uavexp.paths import PACKAGE
from uavexp.store.records import Status
from uavexp.sweep.fork_server import start_fork_server
from uavexp.sweep.job import Allowance, Done, Job
from uavexp.sweep.local import run_local

LIMITS = Allowance(timeout_s=60.0, memory_mb=1000.0)


def jobs(*payloads: tuple[str, Any]) -> list[Job]:
    return [Job(name=str(number), label=deed, payload=(deed, x)) for number, (deed, x) in enumerate(payloads)]


def run(given: Sequence[Job], n_jobs: int = 2, limits: Allowance = LIMITS) -> dict[str, Done]:
    start_fork_server(["tests.jobs"])
    results = list(run_local(act, given, n_jobs=n_jobs, limits=limits))
    assert sorted(done.job.name for done in results) == sorted(job.name for job in given), (
        "none lost, none twice"
    )
    return {done.job.label: done for done in results}


@pytest.fixture(scope="module")
def ended() -> dict[str, Done]:
    """One job of every kind, the good ones between the bad."""
    deeds = ("raise", "nothing", "segfault", "print", "hog", "kill", "leave", "sleep")
    return run(jobs(*((deed, 0.1) for deed in deeds)))


@pytest.mark.parametrize(
    ("deed", "status", "reason"),
    [
        ("nothing", Status.OK, ""),
        ("sleep", Status.OK, ""),
        ("print", Status.OK, ""),
        ("raise", Status.RAISED, "ZeroDivisionError: no such luck"),
        ("segfault", Status.KILLED, "the process was killed by signal 11 (SIGSEGV)"),
        ("kill", Status.KILLED, "the process was killed by signal 9 (SIGKILL)"),
        ("leave", Status.KILLED, "the process ended with exit code 3"),
        ("hog", Status.MEMORY, "MemoryError"),
    ],
)
def test_each_end_has_its_status_and_reason(
    ended: dict[str, Done], deed: str, status: Status, reason: str
) -> None:
    answer = ended[deed].answer
    assert answer.status is status
    assert answer.reason.startswith(reason)
    assert answer.value == (0.2 if status is Status.OK else None)


@pytest.mark.parametrize("deed", ["raise", "segfault"])
def test_a_trace_names_the_place_and_no_path_of_this_machine(ended: dict[str, Done], deed: str) -> None:
    trace = ended[deed].answer.trace
    assert any("tests/jobs.py" in frame and f"_{deed}" in frame for frame in trace)
    assert not any(str(PACKAGE.parent) in frame for frame in trace)


@pytest.mark.parametrize("deed", ["sleep", "spin"])
def test_a_job_that_hangs_is_ended_at_its_limit(deed: str) -> None:
    begin_s = time.monotonic()
    done = run(jobs((deed, 60.0)), limits=Allowance(timeout_s=1.0, memory_mb=1000.0))[deed]
    assert done.answer.status is Status.HUNG
    assert done.answer.reason == "not done after 1 s"
    assert 1.0 <= done.wall_s < 30.0
    assert time.monotonic() - begin_s < 50.0


def test_memory_within_the_limit_is_granted() -> None:
    assert run(jobs(("hog_a_little", 1.0)))["hog_a_little"].answer.status is Status.OK


@pytest.mark.parametrize(
    ("deed", "status"),
    [
        ("nothing", Status.OK),
        ("raise", Status.RAISED),
        ("kill", Status.KILLED),
        ("sleep", Status.HUNG),
        ("grow", Status.OK),
    ],
)
def test_a_child_goes_on_after_what_went_well_and_loses_no_other_job(
    deed: str, status: Status, tmp_path: Path
) -> None:
    """Job 5 of 7 fails, or leaves its process half a GB larger: a new one takes over."""
    given = jobs(
        *[("note", tmp_path)] * 4, (deed, 60.0 if deed == "sleep" else 1.0), *[("note", tmp_path)] * 2
    )
    start_fork_server(["tests.jobs"])
    limits = Allowance(timeout_s=5.0, memory_mb=1000.0)
    done = {int(item.job.name): item for item in run_local(act, given, n_jobs=1, limits=limits)}
    assert [done[number].answer.status for number in range(7)] == [Status.OK] * 4 + [status] + [Status.OK] * 2
    assert len(noted(tmp_path)) == (1 if deed == "nothing" else 2)


def test_a_child_is_replaced_after_its_share_of_jobs(tmp_path: Path) -> None:
    start_fork_server(["tests.jobs"])
    for _ in run_local(act, jobs(*[("note", tmp_path)] * 40), n_jobs=1, limits=LIMITS):
        pass
    assert len(noted(tmp_path)) == 2


def test_a_crash_shows_no_frame_that_an_earlier_job_printed() -> None:
    start_fork_server(["tests.jobs"])
    given = jobs(("print_frame", 1.0), ("segfault", 1.0))
    _, crashed = list(run_local(act, given, n_jobs=1, limits=LIMITS))
    assert crashed.answer.trace
    assert not any("long_ago" in frame for frame in crashed.answer.trace)


def test_progress_comes_from_the_child() -> None:
    told: list[tuple[str, float, str]] = []
    start_fork_server(["tests.jobs"])
    for _ in run_local(
        act,
        jobs(("nothing", 1.0)),
        n_jobs=1,
        limits=LIMITS,
        watch=lambda job, *what: told.append((job.label, *what)),
    ):
        pass
    assert told == [("nothing", 0.0, "begun"), ("nothing", 1.0, "done")]


@pytest.mark.parametrize("n_jobs", [1, 2])
def test_who_stops_listening_leaves_no_child(n_jobs: int, tmp_path: Path) -> None:
    start_fork_server(["tests.jobs"])
    given = jobs(("nothing", 1.0), *[("note_and_sleep", tmp_path)] * 4)
    results = run_local(act, given, n_jobs=n_jobs, limits=LIMITS)
    assert next(results).answer.status is Status.OK
    if n_jobs == 2:
        wait_for(lambda: len(noted(tmp_path)) >= 1)
    results.close()
    wait_for(lambda: not any(map(alive, noted(tmp_path))))


@pytest.mark.parametrize("deed", ["note_and_sleep", "note_and_spin"])
def test_children_die_with_a_supervisor_that_is_killed(deed: str, tmp_path: Path) -> None:
    code = (
        "import sys; from pathlib import Path; from tests.unit.sweep.test_local import *; "
        f"run(jobs(*[({deed!r}, Path(sys.argv[1]))] * 4))"
    )
    variables = {**os.environ, "PYTHONPATH": str(PACKAGE.parent)}
    supervisor = subprocess.Popen([sys.executable, "-c", code, str(tmp_path)], env=variables)
    wait_for(lambda: len(noted(tmp_path)) >= 2)
    children = noted(tmp_path)
    assert all(map(alive, children))
    supervisor.send_signal(signal.SIGKILL)
    supervisor.wait()
    wait_for(lambda: not any(map(alive, children)))
    assert noted(tmp_path) == children, "no other was started"


_INTERRUPTED = """
import os, signal, time
from multiprocessing import forkserver
from tests.unit.sweep.test_local import *

def connect(fds):
    pair = _connect(fds)
    os.kill(os.getpid(), signal.SIGINT)
    time.sleep(0.2)
    return pair

_connect, forkserver.connect_to_new_process = forkserver.connect_to_new_process, connect
try:
    run(jobs(("sleep", 60.0)), n_jobs=int(sys.argv[1]))
except KeyboardInterrupt:
    print("interrupted")
"""


@pytest.mark.parametrize("n_jobs", [1, 2])
def test_an_interrupt_finds_no_child_half_begun(n_jobs: int) -> None:
    variables = {**os.environ, "PYTHONPATH": str(PACKAGE.parent)}
    ended = subprocess.run(
        [sys.executable, "-c", _INTERRUPTED, str(n_jobs)],
        env=variables,
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert (ended.returncode, ended.stdout, ended.stderr) == (0, "interrupted\n", "")


@pytest.mark.parametrize("values", [{"timeout_s": 0.0}, {"memory_mb": -1.0}, {"timeout_s": float("inf")}])
def test_limits_must_be_positive_and_finite(values: dict[str, float]) -> None:
    with pytest.raises(ConfigError, match="must be > 0 and finite"):
        Allowance(**{"timeout_s": 1.0, "memory_mb": 1.0, **values})


def noted(folder: Path) -> set[int]:
    """Processes that left word."""
    return {int(item.name) for item in folder.iterdir()}


def alive(pid: int) -> bool:
    """Whether a process runs; a zombie does not."""
    try:
        state = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
    except (FileNotFoundError, ProcessLookupError):
        return False
    return state not in "ZX"


def wait_for(condition: Any, limit_s: float = 50.0) -> None:
    """Wait until something is so; fail when it does not come."""
    end_s = time.monotonic() + limit_s
    while not condition():
        assert time.monotonic() < end_s, "waited in vain"
        time.sleep(0.02)

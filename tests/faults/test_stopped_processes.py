"""A process that is stopped (SIGSTOP) holds nobody up: the deadline ends it, and so does Ctrl-C."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Iterator
from multiprocessing import forkserver
from pathlib import Path

import pytest

from tests.jobs import act
from tests.sweeps import QUICK, begin
from uavexp.store.records import Status
from uavexp.sweep.fork_server import start_fork_server
from uavexp.sweep.job import Allowance, Done, Job
from uavexp.sweep.local import run_local

LIMITS = Allowance(timeout_s=4.0, memory_mb=1000.0)


def start(*deeds: str, n_jobs: int = 1) -> Iterator[Done]:
    start_fork_server(["tests.jobs"])
    given = [Job(name=str(number), label=deed, payload=(deed, 1.0)) for number, deed in enumerate(deeds)]
    return run_local(act, given, n_jobs=n_jobs, limits=LIMITS)


@pytest.mark.parametrize("n_jobs", [1, 2])
def test_a_child_stopped_in_mid_answer_is_ended_at_its_deadline(n_jobs: int) -> None:
    """Half a message came, and the supervisor read on for ever."""
    begin_s = time.monotonic()
    done = {item.job.label: item.answer for item in start("nothing", "answer_half", "sleep", n_jobs=n_jobs)}
    assert time.monotonic() - begin_s < 40.0
    assert {label: answer.status for label, answer in done.items()} == {
        "nothing": Status.OK, "answer_half": Status.HUNG, "sleep": Status.OK
    }  # fmt: skip


def test_a_stopped_fork_server_costs_one_trial_its_time_and_is_replaced() -> None:
    start_fork_server(["tests.jobs"])
    server = forkserver._forkserver._forkserver_pid  # type: ignore[attr-defined]
    os.kill(server, signal.SIGSTOP)
    begin_s = time.monotonic()
    done = list(start("nothing", "nothing"))
    assert time.monotonic() - begin_s < 40.0
    assert [item.answer.status for item in done] == [Status.HUNG, Status.OK]


def test_a_child_under_a_stopped_fork_server_is_ended_at_its_deadline() -> None:
    begin_s = time.monotonic()
    done = list(start("stop_parent_and_sleep", "nothing"))
    assert time.monotonic() - begin_s < 40.0
    assert [item.answer.status for item in done] == [Status.HUNG, Status.OK]


@pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="reads /proc")
@pytest.mark.parametrize("stopped", ["server", "children"])
def test_an_interrupt_ends_what_is_stopped(stopped: str, tmp_path: Path) -> None:
    process = begin(*QUICK, "strategy=mcr", "seed=0:40", "runner.n_jobs=2", f"out={tmp_path / 'out'}")
    assert process.stdout is not None
    process.stdout.readline()  # "flying ..."
    time.sleep(0.5)
    servers = [pid for pid in below(process.pid) if "forkserver" in cmdline(pid)]
    targets = servers if stopped == "server" else [pid for server in servers for pid in below(server)]
    for pid in targets:
        os.kill(pid, signal.SIGSTOP)
    time.sleep(1.0)
    begin_s = time.monotonic()
    process.send_signal(signal.SIGINT)
    _, error = process.communicate(timeout=120)
    assert (process.returncode, error) == (130, "interrupted\n")
    assert time.monotonic() - begin_s < 40.0
    assert not [pid for pid in targets if Path(f"/proc/{pid}").exists() and cmdline(pid)]


def below(pid: int) -> list[int]:
    return [int(child) for child in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]


def cmdline(pid: int) -> str:
    return Path(f"/proc/{pid}/cmdline").read_text()

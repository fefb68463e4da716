"""Any address of a Dask scheduler, and any scheduler there, is one line in half a minute, then the end."""

from __future__ import annotations

import contextlib
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.sweeps import QUICK, begin, records, variables
from uavexp.__main__ import main

pytest.importorskip("distributed", reason="Dask is an extra: pip install 'uavexp[dask]'")
LIMIT_S = 30.0  # said to a user
_SCHEDULER = """
import asyncio, sys
from distributed import Scheduler, Worker
async def main():
    async with Scheduler(host="127.0.0.1", port=0, dashboard_address=None) as scheduler:
        async with contextlib.AsyncExitStack() as stack:
            if sys.argv[1] == "worker":
                await stack.enter_async_context(Worker(scheduler.address, nthreads=1))
            print(scheduler.address, flush=True)
            await asyncio.sleep(300)
import contextlib, logging
logging.disable(logging.CRITICAL)
asyncio.run(main())
"""


@contextlib.contextmanager
def scheduler(kind: str) -> Iterator[tuple[str, subprocess.Popen[str]]]:
    """Address and process of a scheduler, with a worker in it or without."""
    command = [sys.executable, "-c", _SCHEDULER, kind]
    with subprocess.Popen(command, env=variables(), stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        try:
            yield process.stdout.readline().strip(), process
        finally:
            process.kill()


@pytest.mark.parametrize(
    "address",
    ["nonsense", "tcp://", "tcp://host", "http://127.0.0.1:80", "tcp://127.0.0.1:0", "tcp://127.0.0.1:99999",
     "inproc://1", "ucx://a:1", "tcp://a b:1", "tcp://a:1/x", "tcp://a:١", ""],
)  # fmt: skip
def test_an_address_that_is_none_is_refused_at_once(
    address: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Some were a traceback, and the process never ended."""
    assert main([*QUICK, "runner=dask", f"runner.address='{address}'", f"out={tmp_path / 'out'}"]) == 2
    error = capsys.readouterr().err
    assert "runner.address must be tcp://HOST:PORT" in error
    assert error.count("\n") == 1


@pytest.mark.parametrize("kind", ["silent", "alone"])
def test_who_does_not_answer_or_has_no_worker_is_told_in_time(kind: str, tmp_path: Path) -> None:
    with contextlib.ExitStack() as stack:
        if kind == "silent":
            listener = stack.enter_context(socket.create_server(("127.0.0.1", 0)))
            address, words = f"tcp://127.0.0.1:{listener.getsockname()[1]}", "no Dask scheduler answers"
        else:
            (address, _), words = stack.enter_context(scheduler("alone")), "the scheduler has no worker"
        begin_s = time.monotonic()
        process = begin(*QUICK, "runner=dask", f"runner.address={address}", f"out={tmp_path / 'out'}")
        _, error = process.communicate(timeout=120)
        assert time.monotonic() - begin_s < LIMIT_S
        assert (process.returncode, error.count("\n")) == (2, 1), error
        assert words in error
        assert not (tmp_path / "out").exists()


def test_a_scheduler_that_is_lost_is_one_line_and_loses_no_record(tmp_path: Path) -> None:
    with scheduler("worker") as (address, there):
        typed = (
            *QUICK,
            "world_seed=0",
            "seed=0:40",
            "runner=dask",
            f"runner.address={address}",
            f"out={tmp_path / 'out'}",
        )
        process = begin(*typed)
        while not records(tmp_path / "out"):
            assert process.poll() is None
            time.sleep(0.02)
        there.send_signal(signal.SIGKILL)
        begin_s = time.monotonic()
        _, error = process.communicate(timeout=120)
    assert time.monotonic() - begin_s < LIMIT_S
    assert (process.returncode, error.count("\n")) == (1, 1), error
    assert "the Dask cluster was lost" in error
    assert records(tmp_path / "out")
    assert (tmp_path / "out" / "trials.parquet").is_file()

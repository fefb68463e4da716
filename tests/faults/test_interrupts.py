"""Ctrl-C is one line, from the moment on at which a command can hear it."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from tests.sweeps import QUICK, begin, variables
from uavexp.interrupts import exit_code_of, leave_at_once, raise_from_now_on


def wait_until_it_hears(process: subprocess.Popen[str]) -> None:
    """Until SIGTERM, which Python itself leaves alone, has a handler."""
    status = Path(f"/proc/{process.pid}/status")
    while process.poll() is None:
        caught = next(line for line in status.read_text().splitlines() if line.startswith("SigCgt"))
        if int(caught.split()[1], 16) >> (signal.SIGTERM - 1) & 1:
            return
        time.sleep(0.002)


@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="reads /proc")
@pytest.mark.parametrize("delay_s", [0.0, 0.1, 0.25, 0.5, 0.8, 1.2, 1.7, 2.3])
def test_an_interrupt_of_a_whole_group_is_one_line(delay_s: float, tmp_path: Path) -> None:
    """Within an import it came out as a missing library, or as a class that cannot be made."""
    process = begin(*QUICK, "seed=0:3", f"out={tmp_path / 'out'}")
    wait_until_it_hears(process)
    time.sleep(delay_s)
    os.killpg(process.pid, signal.SIGINT)  # as a terminal does: the fork server and the children, too
    _, error = process.communicate(timeout=120)
    assert (process.returncode, error) == (130, "interrupted\n")


@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="reads /proc")
@pytest.mark.parametrize("delay_s", [0.2, 1.0])
@pytest.mark.parametrize("command", ["check", "export", "show"])
def test_other_commands_that_still_load_end_in_one_line(command: str, delay_s: float) -> None:
    process = subprocess.Popen(
        [sys.executable, "-m", f"uavexp.{command}", "no_such_folder"], stderr=subprocess.PIPE, text=True
    )
    wait_until_it_hears(process)
    time.sleep(delay_s)
    was_running = process.poll() is None
    process.send_signal(signal.SIGINT)
    _, error = process.communicate(timeout=120)
    if was_running and not error.startswith("error: "):  # it had said all, and was ending
        assert (process.returncode, error) == (130, "interrupted\n")


def test_an_interrupt_that_came_through_exec_is_an_exit_code(tmp_path: Path) -> None:
    """CPython remembers it and ends a `-m` process by the signal, caught or not (Modules/main.c)."""
    (tmp_path / "late.py").write_text(
        "import sys; import uavexp.sweep.run as sweep; from uavexp.__main__ import main\n"
        "sweep._world_checks = lambda agenda: exec('raise KeyboardInterrupt')\n"
        f"sys.exit(main([*{QUICK!r}, 'seed=0:2', 'out={tmp_path / 'out'}']))\n"
    )
    command = [sys.executable, "-m", "late"]
    late = subprocess.run(command, cwd=tmp_path, env=variables(), capture_output=True, text=True)
    assert (late.returncode, late.stderr) == (130, "interrupted\n")


def test_a_study_does_not_outlive_the_results_that_it_is_flown_for(tmp_path: Path) -> None:
    """Told by its process id alone, as `kill` does: the study itself hears nothing."""
    study = "import os, time; print(os.getpid(), flush=True); time.sleep(60)"
    flies = (
        "import sys; from uavexp.interrupts import *; from uavexp.results.__main__ import _ended; "
        f"leave_at_once(); raise_from_now_on(); command = [sys.executable, '-c', {study!r}]; "
        "sys.exit(exit_code_of(lambda: _ended(command)))"
    )
    process = subprocess.Popen(
        [sys.executable, "-c", flies], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    assert process.stdout is not None
    pid = int(process.stdout.readline())
    process.terminate()
    _, error = process.communicate(timeout=60)
    assert (process.returncode, error) == (130, "interrupted\n")
    with pytest.raises(ProcessLookupError):
        os.kill(pid, 0)


@pytest.mark.parametrize("as_a_command", [False, True])
def test_what_hears_signals_after_a_command_is_what_heard_them_before(as_a_command: bool) -> None:
    numbers = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
    before = {number: signal.getsignal(number) for number in numbers}
    try:
        for number in numbers:
            signal.signal(number, signal.SIG_DFL)
        if as_a_command:
            leave_at_once()
        heard = [signal.getsignal(number) for number in numbers]
        assert exit_code_of(lambda: raise_from_now_on() or 0) == 0
        assert [signal.getsignal(number) for number in numbers] == heard
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)

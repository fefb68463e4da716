"""A component of one's own raises, prints or is looked at in a debugger, as docs/debugging.md says."""

from __future__ import annotations

import shlex
import subprocess
import sys
from pathlib import Path

from tests.sweeps import QUICK, run, variables
from uavexp.paths import PACKAGE

FAULTY = (*QUICK, "--config-dir", str(PACKAGE.parent / "tests" / "faulty"), "trigger=faulty", "seed=0")
TRUST = {"UAVEXP_TRUST": "tests"}


def test_a_trial_that_raises_says_where_and_is_repeated_by_its_line(tmp_path: Path) -> None:
    done = run(*FAULTY, "trigger.deed=raise", f"out={tmp_path / 'run'}", **TRUST)
    assert done.returncode == 1, done.stderr
    told = dict(line.split(None, 1) for line in done.stdout.splitlines() if ":" in line.split()[0])
    assert "  in tests/jobs.py:" in done.stdout
    assert 'raise ZeroDivisionError("no such luck")' in done.stdout
    assert "ZeroDivisionError" in Path(told["record:"]).read_text()
    line = told["repeat:"].replace("python", sys.executable, 1) + f" out={tmp_path / 'again'}"
    again = subprocess.run(["env", *shlex.split(line)], env=variables(UAVEXP_TRUST=""), capture_output=True)
    assert again.returncode == 1, again.stderr
    assert b"ZeroDivisionError: no such luck" in again.stdout


def test_what_a_single_trial_prints_comes_through_once(tmp_path: Path) -> None:
    done = run(*FAULTY, "trigger.deed=print_once", f"out={tmp_path}", **TRUST)
    assert done.returncode == 0, done.stderr
    assert done.stdout.count("first line\nhalf a line") == 1
    both = run(
        *FAULTY, "trigger.deed=print_once,print", "runner.n_jobs=1", f"out={tmp_path / 'two'}", **TRUST
    )
    assert "first line" not in both.stdout, "of several trials nobody could tell which"


def test_debug_flies_where_a_debugger_is(tmp_path: Path) -> None:
    typed = [sys.executable, "-m", "pdb", "-m", "uavexp", *FAULTY, "trigger.deed=raise", "--debug"]
    script = "continue\np 'its argument', _\nq\nq\n"
    done = subprocess.run(
        [*typed, f"out={tmp_path / 'run'}"],
        env=variables(**TRUST),
        input=script,
        text=True,
        capture_output=True,
    )
    assert "Uncaught exception. Entering post mortem debugging" in done.stdout, done.stderr
    assert "('its argument', 60.0)" in done.stdout, "the frame that raised"
    assert not (tmp_path / "run").exists(), "nothing is kept of it"


def test_debug_is_refused_on_a_cluster(tmp_path: Path) -> None:
    done = run(*QUICK, "runner=dask", "--debug", f"out={tmp_path / 'run'}")
    assert done.returncode == 2
    assert done.stderr == "error: --debug flies in this process: leave runner=dask away\n"

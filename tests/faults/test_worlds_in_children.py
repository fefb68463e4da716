"""A stranger's world is made in a child under limits: whatever that comes to is one line; nothing is kept."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.sweeps import QUICK, run
from uavexp.paths import PACKAGE

FAULTY = ("--config-dir", str(PACKAGE.parent / "tests" / "faulty"))


@pytest.mark.parametrize(
    ("deed", "words"),
    [
        ("segfault", "signal 11 (SIGSEGV)"),
        ("hog", "MemoryError"),
        ("sleep", "not done after 8 s"),
        ("raise", "ZeroDivisionError: no such luck"),
        ("raise_bad_input", "no such device"),
    ],
)
def test_a_world_that_cannot_be_made_ends_the_command_in_one_line(
    deed: str, words: str, tmp_path: Path
) -> None:
    """A native reader's abort, or an archive that fills the memory, took the whole sweep with it."""
    typed = [name for name in QUICK if not name.startswith("world")]
    limits = (f"runner.timeout_s={8 if deed == 'sleep' else 60}", "runner.memory_mb=1000")
    out = tmp_path / "out"
    done = run(
        *FAULTY, *typed, "world=terrible", f"world.deed={deed}", "seed=0:2", f"out={out}", *limits,
        UAVEXP_TRUST="tests",
    )  # fmt: skip
    assert done.returncode == 2, done.stderr
    assert done.stderr.startswith("error: ")
    assert done.stderr.count("\n") == 1
    assert words in done.stderr
    assert not list(out.glob("trials/*"))

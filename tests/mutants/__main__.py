"""Break the core line by line in a copy of the checkout; print which breaks no test notices.

`python -m tests.mutants [WORD]`: all, or those whose file's name holds the word.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

import yaml

ROOT = Path(__file__).parents[2]
MOST_SURVIVORS = 3
_COPIED = ("uavexp", "tests", "conf", "experiments", "benchmarks", "analysis", "docs", "examples")


class Mutant(NamedTuple):
    """One line of the core broken."""

    file: str  # below uavexp/, without .py
    old: str  # stands there once
    new: str
    tests: str  # files or folders below tests/, separated by blanks


def listed() -> list[Mutant]:
    """All of them."""
    text = Path(__file__).with_name("mutants.yaml").read_text(encoding="utf-8")
    return [Mutant(**entry) for entry in yaml.safe_load(text)]


def _copy(into: Path) -> None:
    """The checkout without its history, its environment and what was flown; times kept, for the kernels."""
    for item in ROOT.iterdir():
        if item.is_dir() and item.name in _COPIED:
            shutil.copytree(item, into / item.name)
        elif item.is_file():
            shutil.copy2(item, into / item.name)


@contextmanager
def _broken(mutant: Mutant, copy: Path) -> Iterator[None]:
    file = copy / "uavexp" / f"{mutant.file}.py"
    sound, stat = file.read_text(encoding="utf-8"), file.stat()
    if sound.count(mutant.old) != 1:
        raise SystemExit(f"{mutant.file}: not once there: {mutant.old}")
    file.write_text(sound.replace(mutant.old, mutant.new), encoding="utf-8")
    yield
    file.write_text(sound, encoding="utf-8")
    os.utime(file, ns=(stat.st_atime_ns, stat.st_mtime_ns))


def is_noticed(mutant: Mutant, copy: Path) -> bool:
    """Whether a test fails of it."""
    tests = [f"tests/{part}" for part in mutant.tests.split()]
    command = [sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider", *tests]
    with _broken(mutant, copy):
        ran = subprocess.run(command, cwd=copy, capture_output=True, check=False, text=True)
    if ran.returncode not in (0, 1, 2):  # 2: it cannot even be imported
        raise SystemExit(f"{' '.join(command)} did not run:\n{ran.stdout[-2000:]}{ran.stderr[-2000:]}")
    return ran.returncode != 0


def main() -> int:
    """Try them; 1 when more survive than may."""
    wanted = sys.argv[1] if len(sys.argv) > 1 else ""
    mutants = [mutant for mutant in listed() if wanted in mutant.file]
    survivors = 0
    with tempfile.TemporaryDirectory() as folder:
        _copy(Path(folder))
        for n, mutant in enumerate(mutants):
            begin = time.perf_counter()
            noticed = is_noticed(mutant, Path(folder))
            word, took_s = "noticed " if noticed else "SURVIVED", time.perf_counter() - begin
            survivors += not noticed
            print(
                f"{n + 1:2d}/{len(mutants)} {word} {took_s:4.0f} s  {mutant.file}: {mutant.new}", flush=True
            )
    print(f"{survivors} of {len(mutants)} survived, at most {MOST_SURVIVORS} may")
    return int(survivors > MOST_SURVIVORS)


if __name__ == "__main__":
    sys.exit(main())

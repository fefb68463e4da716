"""`python -m benchmarks.against REV`: this checkout against another revision, in ratios of time.

REV stands in a git worktree of its own, whose kernels are compiled first (minutes of one core). Then both
fly the same, by turns, in an order that turns too: flights, each in a process that has flown before, by its
user time; and a study on two workers, seed by seed, by the clock. What else runs on the machine meets both
alike, so that only ratios are printed: this checkout's time over REV's.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import IO, TypeVar, cast

from rich.console import Console

from uavexp.store.study import TRIALS, read_runs

T = TypeVar("T")
ROOT = Path(__file__).resolve().parents[1]
WAREHOUSE = ("strategy=mcr", "world=warehouse")
PARTS = {
    "flights": WAREHOUSE,
    "images": (*WAREHOUSE, "sensor.width_px=320", "sensor.height_px=240"),
    "study": ("experiments=mcr/table1", "runner.n_jobs=2"),
}
SEEDS = {"flights": range(5), "images": range(5), "study": range(4)}
# composes and loads its kernels in a first flight; only building, flying and measuring are timed
PILOT = """
import json, resource, sys, uavexp
first = uavexp.fly(*sys.argv[1:], "seed=0")
fly_cell = sys.modules[type(first).__module__].fly_cell
print(flush=True)
for line in sys.stdin:
    begin_s = resource.getrusage(resource.RUSAGE_SELF).ru_utime
    trial = fly_cell(first.cell, int(line))
    user_s = resource.getrusage(resource.RUSAGE_SELF).ru_utime - begin_s
    print(json.dumps([user_s, trial.metrics["completion_time_s"]]), flush=True)
"""
Fly = Callable[[int], tuple[float, float]]  # seed -> user time s, flown s


@dataclass(frozen=True, slots=True, kw_only=True)
class Study:
    """What one command that flies a study took, by the clock."""

    first_s: float  # until its first trial was kept
    trials_per_minute: float  # from the first flight's begin to the last one's end


@dataclass(frozen=True, slots=True)
class Checkout:
    """A source tree, run by this interpreter with the packages that are installed here."""

    root: Path

    def python(self, *arguments: str) -> subprocess.Popen[str]:
        """Start Python in this tree."""
        return subprocess.Popen(
            [sys.executable, *arguments],
            cwd=self.root,
            env={**os.environ, "PYTHONPATH": str(self.root), "PYTHONUNBUFFERED": "1"},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )

    @contextlib.contextmanager
    def pilot(self, overrides: Sequence[str]) -> Iterator[Fly]:
        """A process that flies one seed after another."""
        with self.python("-c", PILOT, *overrides) as process:
            asked, answers = cast(IO[str], process.stdin), cast(IO[str], process.stdout)
            answers.readline()

            def fly(seed: int) -> tuple[float, float]:
                print(seed, file=asked, flush=True)
                user_s, flown_s = json.loads(answers.readline())
                return user_s, flown_s

            yield fly

    def study(self, seed: int, *overrides: str) -> Study:
        """Fly a study into a folder that is removed again."""
        with tempfile.TemporaryDirectory() as place:
            folder, begin_s = Path(place) / "study", time.perf_counter()
            with self.python(
                "-m", "uavexp", *PARTS["study"], f"seed={seed}", *overrides, f"out={folder}"
            ) as process:
                while process.poll() is None and not any((folder / TRIALS).glob("[!.]*")):
                    time.sleep(0.01)
                first_s = time.perf_counter() - begin_s
                process.communicate()
            (run,) = read_runs(folder)
            return Study(first_s=first_s, trials_per_minute=60.0 * run["flown"] / run["wall_s"])


@contextlib.contextmanager
def worktree(revision: str, kept: Path | None) -> Iterator[Checkout]:
    """A revision in a worktree: a new one that is removed again, or one that stays for the next time."""
    git = ("git", "-C", str(ROOT), "worktree")
    with tempfile.TemporaryDirectory() as temporary:
        place = kept or Path(temporary) / "old"
        if not place.exists():
            subprocess.run([*git, "add", "--quiet", "--detach", str(place), revision], check=True)
        try:
            yield Checkout(place)
        finally:
            if kept is None:
                subprocess.run([*git, "remove", "--force", str(place)], check=True)


def flight_ratios(old: Checkout, new: Checkout, part: str) -> str:
    """Ratios of user time, and of the time flown, which tells whether the flights are the same."""
    with old.pilot(PARTS[part]) as fly_old, new.pilot(PARTS[part]) as fly_new:
        pairs = [by_turns(seed, fly_old, fly_new) for seed in SEEDS[part]]
    times = [after[0] / before[0] for before, after in pairs]
    flown = [after[1] / before[1] for before, after in pairs]
    return f"user time of a flight {spread(times)}; time flown {spread(flown)}"


def study_ratios(old: Checkout, new: Checkout, part: str) -> str:
    """Ratios of trials a minute and of the time to the first trial."""
    pairs = [by_turns(seed, old.study, new.study) for seed in SEEDS[part]]
    rates = [after.trials_per_minute / before.trials_per_minute for before, after in pairs]
    firsts = [after.first_s / before.first_s for before, after in pairs]
    seconds = statistics.median(after.first_s for _, after in pairs)
    return f"trials a minute {spread(rates)}; first trial after {spread(firsts)}, here {seconds:.1f} s"


def by_turns(seed: int, old: Callable[[int], T], new: Callable[[int], T]) -> tuple[T, T]:
    """Measure old and new; at every other seed new comes first."""
    if seed % 2:
        after = new(seed)
        return old(seed), after
    return old(seed), new(seed)


def spread(ratios: Sequence[float]) -> str:
    """Median and range."""
    return f"x {statistics.median(ratios):.2f} ({min(ratios):.2f} to {max(ratios):.2f}, {len(ratios)} pairs)"


def main() -> None:
    """Warm both, compare, print."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.against", description=__doc__)
    parser.add_argument("revision", metavar="REV")
    parser.add_argument("--parts", default=",".join(SEEDS), help="of flights,images,study")
    parser.add_argument("--keep", type=Path, metavar="DIR", help="for REV's worktree, compiled once")
    asked = parser.parse_args()
    console = Console(highlight=False, soft_wrap=True)
    with worktree(asked.revision, asked.keep) as old:
        new = Checkout(ROOT)
        console.print("compiling what is not compiled yet ...")
        for tree in (old, new):
            tree.study(50, "arm=MCR")
        for part in asked.parts.split(","):
            console.print(f"{part} ({' '.join(PARTS[part])}): ", end="")
            compare = study_ratios if part == "study" else flight_ratios
            console.print(compare(old, new, part))


if __name__ == "__main__":
    main()

"""`make fuzz`: commands, short flights, folders and kills by chance; prints counts, fails on any fault."""

from __future__ import annotations

import argparse
import os
import random
import sys
import tempfile
import time
import warnings
from collections import Counter
from collections.abc import Iterable
from pathlib import Path

from tests.fuzz import commands, flights, folders, kills
from tests.fuzz.watch import in_time
from uavexp.config.composition import Composer

_LIMIT_S = 120.0  # of one command or one folder


def main() -> int:
    """Run every part; 1 if there was a fault."""
    counts = argparse.ArgumentParser(prog="python -m tests.fuzz", description=__doc__)
    for name, count in (("commands", 10_000), ("flights", 1_000), ("folders", 1_000), ("kills", 100)):
        counts.add_argument(f"--{name}", type=int, default=count, metavar="N")
    counts.add_argument("--seed", type=int, default=0, help="of all that is drawn")
    asked = counts.parse_args()
    warnings.simplefilter("ignore")
    os.environ["MPLBACKEND"] = "Agg"
    faults = 0
    with tempfile.TemporaryDirectory() as place:
        os.environ["XDG_CACHE_HOME"] = f"{place}/cache"
        for name, run in _PARTS.items():
            if count := getattr(asked, name):
                faults += _told(name, run(count, asked.seed, Path(place) / name))
    return 1 if faults else 0


def _told(name: str, results: Iterable[tuple[str, list[str]]]) -> int:
    """Print the faults of a part as they come, then its counts; how many faults."""
    begin_s, counts, found = time.monotonic(), Counter[str](), 0
    for kind, faults in results:
        counts[kind] += 1
        found += len(faults)
        for fault in faults:
            print(f"{name}: {fault}", flush=True)
    kinds = ", ".join(f"{count} {kind}" for kind, count in sorted(counts.items()))
    total, wall_s = counts.total(), time.monotonic() - begin_s
    print(f"{name}: {total} in {wall_s:.0f} s ({kinds}); {found} faults", flush=True)
    return found


def _commands(count: int, seed: int, place: Path) -> Iterable[tuple[str, list[str]]]:
    composer = Composer(many=True)
    for number in range(count):
        words = commands.drawn(composer, random.Random(f"{seed} {number}"))
        with in_time(_LIMIT_S):
            command, faults = commands.faults_of(composer, words)
        yield "composed" if command else "refused", faults


def _flights(count: int, seed: int, place: Path) -> Iterable[tuple[str, list[str]]]:
    return flights.fly(Composer(many=True), count, seed, place)


def _folders(count: int, seed: int, place: Path) -> Iterable[tuple[str, list[str]]]:
    study = kills.study(place / "whole")
    for number in range(count):
        with in_time(_LIMIT_S):
            yield "read", folders.faults_of(study, place / "spoilt", seed * count + number, readers=3)


def _kills(count: int, seed: int, place: Path) -> Iterable[tuple[str, list[str]]]:
    study = kills.study(place / "whole")
    for number in range(-(-count // _KILLS_EACH)):
        each = min(_KILLS_EACH, count - number * _KILLS_EACH)
        faults = kills.faults_of(study, place / f"{number}", seed * count + number, each)
        yield f"studies, of {each} kills each", faults


_KILLS_EACH = 5  # of one study
_PARTS = {"commands": _commands, "flights": _flights, "folders": _folders, "kills": _kills}

if __name__ == "__main__":
    sys.exit(main())

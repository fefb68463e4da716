"""From `git clone` to a moving picture of one's own building: three commands, timed in a fresh clone.

    python -m benchmarks.first_picture [FILE]      or  make first [FILE=office.ply]

Packages come from the installer's own cache, if they are there; nothing else is taken from this checkout.
"""

from __future__ import annotations

import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
BUILDING = ROOT / "tests" / "data" / "flat.ply"
LIMIT_S = 300.0
_FROM_MAKE = ("MAKEFLAGS", "MAKELEVEL", "MFLAGS", "PYTHON", "PYTHONPATH", "UV", "VENV", "ARGS", "VIRTUAL_ENV")


def commands(building: Path, place: Path) -> list[list[str]]:
    """The three commands that a newcomer types, with the folders of this run."""
    clone = place / "uavexp"
    flown = f"strategy=safe world=file world.path={building} seed=0 out={place / 'flight'}"
    show = [str(clone / ".venv" / "bin" / "python"), "-m", "uavexp.show", str(place / "flight")]
    return [
        ["git", "clone", "--quiet", str(ROOT), str(clone)],
        ["make", "--no-print-directory", "-C", str(clone), "run", f"ARGS={flown}"],
        [*show, "--gif", str(place / "flight.gif")],
    ]


def main() -> int:
    """Type them; 1 if the picture came too late."""
    building = Path(sys.argv[1]).absolute() if len(sys.argv) > 1 else BUILDING
    variables = {name: value for name, value in os.environ.items() if name not in _FROM_MAKE}
    begin_s = time.monotonic()
    with tempfile.TemporaryDirectory() as name:
        place = Path(name)
        for words in commands(building, place):
            each_s = time.monotonic()
            subprocess.run(words, check=True, cwd=place, env=variables)
            print(f"{time.monotonic() - each_s:6.1f} s  {' '.join(words)}".replace(name, "..."), flush=True)
        size_kb = (place / "flight.gif").stat().st_size / 1e3
    took_s, used = time.monotonic() - begin_s, resource.getrusage(resource.RUSAGE_CHILDREN)
    print(f"{used.ru_utime + used.ru_stime:6.1f} s of processor time")
    print(f"{took_s:6.1f} s to a moving picture of {building.name} ({size_kb:.0f} kB); {LIMIT_S:g} s allowed")
    return 0 if took_s <= LIMIT_S else 1


if __name__ == "__main__":
    sys.exit(main())

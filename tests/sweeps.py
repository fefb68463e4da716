"""Commands in processes of their own, and what they leave behind, compared."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pandas as pd

from uavexp.paths import PACKAGE

# flights of about a second, most of them cut off in mid-flight
QUICK = (
    "vehicle=point_mass",
    "world=random_columns",
    "world.size_m=[8,6,3]",
    "mission.time_base_s=1.0",
    "mission.time_per_path_spm=0.2",
)


def variables(**more: str) -> dict[str, str]:
    """The environment of a command that runs this very package."""
    places = os.pathsep.join([str(PACKAGE.parent), os.environ.get("PYTHONPATH", "")])
    return {**os.environ, "PYTHONPATH": places, "PYTHONUNBUFFERED": "1", **more}


def begin(*typed: str, **more: str) -> subprocess.Popen[str]:
    """Start a command in a session of its own."""
    return subprocess.Popen(
        [sys.executable, "-m", "uavexp", *typed],
        env=variables(**more),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )


def run(*typed: str, **more: str) -> subprocess.CompletedProcess[str]:
    """Run a command to its end."""
    process = begin(*typed, **more)
    out, error = process.communicate(timeout=300)
    return subprocess.CompletedProcess(process.args, process.returncode, out, error)


def records(folder: Path) -> dict[str, bytes]:
    """Record of every trial that stands in a study folder."""
    trials = (folder / "trials").glob("[!.]*")  # a hidden one was being written when the sweep was killed
    return {item.name: (item / "record.json").read_bytes() for item in trials if ".aside-" not in item.name}


def tables(folder: Path) -> tuple[pd.DataFrame, bytes]:
    """Trials without clock times, and the bytes of the replans."""
    trials = pd.read_parquet(folder / "trials.parquet")
    clock = [name for name in trials.columns if name.startswith("wall_")]
    return trials.drop(columns=clock), (folder / "replans.parquet").read_bytes()


def assert_same_study(folder: Path, other: Path) -> None:
    """Fail unless two folders hold the same trials and tables, clock times apart."""
    assert records(folder) == records(other)
    (ours, our_replans), (theirs, their_replans) = tables(folder), tables(other)
    pd.testing.assert_frame_equal(ours, theirs)
    assert our_replans == their_replans
    assert (folder / "study.json").read_bytes() == (other / "study.json").read_bytes()
    for place in ("worlds/*.npz", "trials/*/log.npz"):
        ours_there, theirs_there = (
            {
                item.relative_to(root): item.read_bytes()
                for item in root.glob(place)
                if ".aside-" not in str(item)
            }
            for root in (folder, other)
        )
        assert ours_there == theirs_there

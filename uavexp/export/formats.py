"""Which formats a flight is exported to; the module of a format is imported when it is asked for."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path

from uavexp.errors import ConfigError
from uavexp.interrupts import raise_from_now_on
from uavexp.store.stored_trial import StoredTrial

Write = Callable[[StoredTrial, Path], Sequence[Path]]


@dataclass(frozen=True, slots=True)
class Format:
    """One format: `uavexp.export.<name>` writes it."""

    suffix: str  # of what is written; empty: a folder
    what: str
    extra: str = ""  # the optional dependencies it needs
    package: str = ""  # the one that is imported


FORMATS = {
    "mcap": Format(".mcap", "poses, map, plans, causes for Foxglove", "export", "foxglove-sdk"),
    "csv": Format(".csv", "state and reference, a row per step"),
    "ply": Format(".ply", "the map as a mesh"),
    "octomap": Format(".bt", "the map as an OctoMap octree"),
    "nav2map": Format(".yaml", "the map at flight height for ROS, with its .pgm"),
    "rosbag2": Format("", "a ROS 2 bag (a folder)", "export", "rosbags"),
    "rrd": Format(".rrd", "a Rerun recording", "rerun", "rerun-sdk"),
    "px4": Format(".csv", "PX4 offboard setpoints, north east down"),
}


def export(trial: StoredTrial, to: str, out: Path) -> Sequence[Path]:
    """Write a stored trial in one of the `FORMATS`.

    Args:
        trial: what is written.
        to: name of the format.
        out: file (a folder for a rosbag2); its parent is made.

    Returns:
        What was written.

    Raises:
        ConfigError: a package is missing, or it cannot be written.
    """
    wanted = FORMATS[to]
    try:
        module = import_module(f"uavexp.export.{to}")
    except ImportError as error:
        raise ConfigError(
            f"--to {to} needs {wanted.package} ({error}): pip install {wanted.package}"
        ) from error
    if out.suffix != wanted.suffix and wanted.suffix:
        raise ConfigError(f"--out {out}: a file for --to {to} ends in {wanted.suffix}")
    if to == "rosbag2" and out.exists():
        raise ConfigError(f"--out {out} exists already; a rosbag2 is a new folder: name another one")
    try:
        out.parent.mkdir(parents=True, exist_ok=True)
        raise_from_now_on()
        return _written_whole(module.write, trial, out)
    except OSError as error:
        raise ConfigError(f"--out {out} cannot be written ({error.strerror or error})") from error


def _written_whole(write: Write, trial: StoredTrial, out: Path) -> list[Path]:
    """What was written: whole, or not there at all."""
    with tempfile.TemporaryDirectory(dir=out.parent, prefix=f".{out.name}-") as folder:
        made = write(trial, Path(folder) / out.name)
        own = {path: out.parent / path.name for path in made if path.parent == Path(folder)}
        for path, place in own.items():
            path.replace(place)
    return [own.get(path, path) for path in made]

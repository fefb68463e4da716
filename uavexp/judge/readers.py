"""Which files of flights are read; the module of a format is imported when it is asked for."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path

from uavexp.errors import ConfigError, RecordError, UavexpError, one_line
from uavexp.judge.recording import Recording, checked


@dataclass(frozen=True, slots=True)
class Format:
    """One format: `uavexp.judge.<module>` reads it."""

    module: str
    what: str
    package: str = ""  # that must be there


_BAG = Format("rosbag", "a ROS bag", "rosbags")
_FOXGLOVE = Format("foxglove", "an MCAP of Foxglove's messages", "mcap-protobuf-support")
_PROFILE = slice(21, 25)  # of an MCAP's header: who says what its messages are
READERS = {
    ".ulg": Format("ulog", "a PX4 log", "pyulog"),
    ".bag": _BAG,
    ".db3": _BAG,
    ".mcap": _BAG,
    ".csv": Format("table", "a table"),
    ".txt": Format("table", "a trajectory as TUM writes it"),
    ".tum": Format("table", "a trajectory as TUM writes it"),
}


def read(path: Path, topic: str | None = None) -> Recording:
    """Read a flight.

    Args:
        path: of a file, or the folder of a ROS 2 bag.
        topic: that tells positions, where a file has several.

    Raises:
        RecordError: it cannot be read, is damaged, or tells no positions.
        ConfigError: a package is missing, or the topic.
    """
    if not path.exists():
        raise RecordError(f"{path}: there is no such file")
    suffix = path.suffix.lower()
    wanted = _BAG if path.is_dir() else READERS.get(suffix)
    if suffix == ".mcap" and path.is_file() and not _is_ros(path):
        wanted = _FOXGLOVE
    if wanted is None:
        raise RecordError(
            f"{path}: {suffix or 'no suffix'} is none of {', '.join(READERS)}, a folder a ROS 2 bag"
        )
    try:
        module = import_module(f"uavexp.judge.{wanted.module}")
    except ImportError as error:
        raise ConfigError(f"{path} needs {wanted.package} ({error}): pip install {wanted.package}") from error
    with told(path, wanted.what):
        recording: Recording = module.read(path, topic)
    return checked(recording)


@contextlib.contextmanager
def told(path: Path, what: str) -> Iterator[None]:
    """Tell in one line what a damaged file does to readers that are other people's, and raise what they like.

    Args:
        path: of the file.
        what: it should be.

    Raises:
        RecordError: in place of anything that was no `UavexpError`.
    """
    try:
        yield
    except UavexpError:
        raise
    except OSError as error:
        raise RecordError(f"{path}: cannot be read ({error.strerror or error})") from error
    except Exception as error:
        said = one_line(error) or type(error).__name__
        raise RecordError(f"{path}: damaged, or not {what} ({said[:200]})") from error


def _is_ros(path: Path) -> bool:
    with path.open("rb") as file:
        return file.read(_PROFILE.stop)[_PROFILE].startswith(b"ros")

"""Files of buildings to what they hold: one module per format, found by the file's suffix.

Every fault is one `WorldError` line that names the file, the reason and what to do.
"""

from __future__ import annotations

import errno
import os
from importlib import import_module
from pathlib import Path
from types import ModuleType

import numpy as np

from uavexp.errors import WorldError
from uavexp.formats.base import FREE, SOLID, UNMEASURED, Cells, Content, Options
from uavexp.paths import expanded

__all__ = ["FREE", "READERS", "SOLID", "UNMEASURED", "Cells", "Content", "Options", "files", "read"]

# suffix to its module here, which has `read(path, options)`, and `files(path)` where a file names others;
# a module is imported when a file needs it, and imports at its top the library that it needs
READERS = {
    ".ply": "ply",
    ".obj": "obj",
    ".stl": "stl",
    ".glb": "gltf",
    ".gltf": "gltf",
    ".dae": "collada",
    ".world": "sdf",
    ".sdf": "sdf",
    ".pcd": "pcd",
    ".xyz": "xyz",
    ".pts": "xyz",
    ".asc": "xyz",
    ".txt": "xyz",
    ".npz": "npz",
    ".las": "las",
    ".laz": "las",
    ".bt": "octomap",
    ".ot": "octomap",
    ".3dmap": "movingai",
    ".yaml": "ros_map",
    ".yml": "ros_map",
    ".dxf": "dxf",
    ".wkt": "wkt",
}
LIBRARIES = ("ezdxf", "laspy", "shapely")  # of the extra `formats`


def read(path: Path, options: Options) -> Content:
    """Return what a file holds; raise `WorldError` in one line when it cannot be read whole."""
    _check_file(path)
    try:
        with np.errstate(all="ignore"):  # what overflows is found not to be finite
            content: Content = _module(path).read(path, options)
    except MemoryError as error:
        raise WorldError(f"world file {path} holds more than the memory does; give a part of it") from error
    return content


def located(folder: str, path: str) -> Path:
    """Where a world's file lies; `folder` may be empty. Raises `WorldError` when it does not exist."""
    if folder and not expanded(folder).is_dir():
        raise WorldError(f"folder={folder} does not exist; type world.folder=FOLDER, where {path} lies")
    return expanded(folder) / expanded(path)


def files(path: Path) -> tuple[Path, ...]:
    """Return the files that a file's content depends on, itself first; any suffix is allowed.

    Raises:
        OSError: the file itself does not exist.
        WorldError: it is damaged where it names the others.
    """
    if not path.is_file():
        raise FileNotFoundError(errno.ENOENT, "no such file", str(path))
    if path.suffix.lower() not in READERS:
        return (path,)
    named = getattr(_module(path), "files", None)
    others: tuple[Path, ...] = named(path) if named else ()
    for other in others:
        if not other.is_file():  # nor read from a device or a pipe
            raise WorldError(f"world file {path} names {other}, which is no file")
    return (path, *others)


def _module(path: Path) -> ModuleType:
    try:
        return import_module(f"uavexp.formats.{READERS[path.suffix.lower()]}")
    except ModuleNotFoundError as error:
        library = (error.name or "").partition(".")[0]
        if library not in LIBRARIES:
            raise
        raise WorldError(
            f"world file {path}: reading {path.suffix} needs {library}: pip install 'uavexp[formats]'"
        ) from error


def _check_file(path: Path) -> None:
    """Raise `WorldError` unless `path` is a readable file of a known suffix with something in it."""
    if not path.exists():
        raise WorldError(f"world file {path} does not exist")
    if not path.is_file():
        raise WorldError(f"world file {path} is not a file; one of {' '.join(READERS)} is needed")
    if not os.access(path, os.R_OK):
        raise WorldError(f"world file {path} cannot be read (permission denied)")
    if path.stat().st_size == 0:
        raise WorldError(f"world file {path} is empty (0 bytes)")
    if path.suffix.lower() not in READERS:
        raise WorldError(
            f"world file {path} has the extension {path.suffix!r}; one of {' '.join(READERS)} is needed"
            + (" (give the map's yaml, not its image)" if path.suffix.lower() == ".pgm" else "")
        )

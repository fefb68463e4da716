"""Keeps compiled numba kernels, and knows when they are stale.

Numba recompiles a cached kernel when its own file changes, not when a kernel or constant
that it takes from another file does: it then returns numbers of code that no longer
exists. This locator stamps a kernel with everything its file imports from the package,
directly or not. `uavexp/__init__.py` names it in `NUMBA_CACHE_LOCATOR_CLASSES`.
"""

from __future__ import annotations

import functools
import hashlib
import os
import re
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

VARIABLE = "NUMBA_CACHE_LOCATOR_CLASSES"
LOCATOR = "uavexp.kernel_cache.KernelLocator"
_PACKAGE = Path(__file__).resolve().parent
# not the indented ones: what is imported for type checking alone, or inside a function, is in no kernel
_IMPORT = re.compile(
    r"^(?:from\s+(?P<module>uavexp[\w.]*)\s+import\s+(?P<names>\([^)]*\)|[^\n#]*)|import\s+(?P<plain>uavexp[\w.]*))",
    re.MULTILINE,
)


class KernelLocator:
    """Where the kernels of one source file are kept, and the stamp that they must carry."""

    def __init__(self, line: int, file: Path, folder: Path) -> None:
        self._line = line
        self._file = file
        self._folder = folder

    @classmethod
    def from_function(cls, py_func: Callable[..., Any], py_file: str) -> Any:
        """Locator of a kernel of this package; everybody else's is left to numba's own locators."""
        file = Path(py_file).resolve()
        if file.is_relative_to(_PACKAGE) and file.is_file():
            folder = next((path for path in _folders(file) if _usable(path)), None)
            if folder is not None:
                return cls(py_func.__code__.co_firstlineno, file, folder)
        from numba.core.caching import CacheImpl

        found = (other.from_function(py_func, py_file) for other in CacheImpl._locator_classes)
        return next((locator for locator in found if locator is not None), None)

    def ensure_cache_path(self) -> None:
        """Create the folder; remove what earlier versions of the source file have left there."""
        self._folder.mkdir(parents=True, exist_ok=True)
        for kept in self._folder.glob(f"{self._file.stem}.*.nb[ci]"):
            if f"-{self._name_of_stamp()}." not in kept.name:
                kept.unlink(missing_ok=True)

    def get_cache_path(self) -> str:
        """Folder of the compiled kernels."""
        return str(self._folder)

    def get_source_stamp(self) -> str:
        """sha256 over the file and everything of the package that it imports."""
        return source_stamp(self._file)

    def get_disambiguator(self) -> str:
        """Tell kernels of the same name apart, and versions: an index may name classes that are gone."""
        return f"{self._line}-{self._name_of_stamp()}"

    def _name_of_stamp(self) -> str:
        return self.get_source_stamp()[:12]


def has_kernels() -> bool:
    """Whether any kernel was ever compiled for this copy of the package (else a minute of it lies ahead)."""
    source = _PACKAGE / "planner" / "any.py"
    return any(next(folder.glob("*.nbc"), None) is not None for folder in _folders(source))


@functools.cache
def source_stamp(file: Path) -> str:
    """sha256 over a source file and, transitively, the package files it imports."""
    seen: set[Path] = set()
    waiting = [file]
    while waiting:
        current = waiting.pop()
        if current not in seen:
            seen.add(current)
            waiting.extend(_imports(current))
    total = hashlib.sha256()
    for item in sorted(seen):
        total.update(f"{item.name}\0".encode() + hashlib.sha256(item.read_bytes()).digest())
    return total.hexdigest()


@functools.cache
def _imports(file: Path) -> tuple[Path, ...]:
    """Package files that a source file imports by name."""
    found: list[Path] = []
    for match in _IMPORT.finditer(file.read_text(encoding="utf-8")):
        module = match["module"] or match["plain"]
        names = re.findall(r"\w+", match["names"] or "")
        found += [path for name in (module, *(f"{module}.{name}" for name in names)) for path in _files(name)]
    return tuple(found)


def _files(module: str) -> Iterator[Path]:
    base = _PACKAGE.parent.joinpath(*module.split("."))
    yield from (path for path in (base.with_suffix(".py"), base / "__init__.py") if path.is_file())


def _folders(file: Path) -> Iterator[Path]:
    """Beside the source; else the user's cache; else a private temporary folder."""
    yield file.parent / "__pycache__"
    place = f"{file.parent.name}-{hashlib.sha256(str(file.parent).encode()).hexdigest()[:12]}"
    cache = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    yield Path(cache) / "uavexp" / "kernels" / place
    yield Path(tempfile.gettempdir()) / f"uavexp-kernels-{os.getuid()}" / place


def _usable(folder: Path) -> bool:
    """Whether kernels can be kept here and nobody else can put theirs (they are executed)."""
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=folder).close()
        return folder.name == "__pycache__" or folder.parent.stat().st_uid == os.getuid()
    except OSError:
        return False

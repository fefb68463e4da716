"""A compiled kernel is used again exactly as long as everything it was made of stands."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from uavexp import geometry, kernel_cache
from uavexp.paths import PACKAGE

MAIN = "from uavexp.a import kernel\nprint(kernel(1.0), sum(kernel.stats.cache_hits.values()))"


@pytest.fixture
def package(tmp_path: Path) -> Path:
    """A small package of the same name: kernel -> helper -> constant, in three files."""
    folder = tmp_path / "uavexp"
    folder.mkdir()
    shutil.copy(PACKAGE / "kernel_cache.py", folder)
    (folder / "__init__.py").write_text(
        "import os\nfrom uavexp.kernel_cache import LOCATOR, VARIABLE\nos.environ[VARIABLE] = LOCATOR\n"
    )
    header = "import numba as nb\n"
    (folder / "c.py").write_text("FACTOR = 20.0\n")
    (folder / "b.py").write_text(
        header + "from uavexp.c import FACTOR\n@nb.njit\ndef helper(x): return FACTOR * x\n"
    )
    (folder / "a.py").write_text(
        header
        + "from uavexp import b\nhelper = b.helper\n@nb.njit(cache=True)\ndef kernel(x): return helper(x)\n"
    )
    (folder / "unrelated.py").write_text("x = 1\n")
    return folder


def run(package: Path) -> tuple[float, int]:
    """Value of the kernel in a fresh process, and how many kernels came from the cache."""
    environment = {**os.environ, "PYTHONPATH": str(package.parent), "PYTHONDONTWRITEBYTECODE": "1"}
    environment.pop(kernel_cache.VARIABLE)
    done = subprocess.run(
        [sys.executable, "-c", MAIN],
        env=environment,
        cwd=package.parent,
        capture_output=True,
        text=True,
        check=True,
    )
    value, hits = done.stdout.split()
    return float(value), int(hits)


def test_a_kernel_notices_a_change_two_files_away(package: Path) -> None:
    """Regression: numba's own cache returned 20 where 60 was right."""
    assert run(package) == (20.0, 0)
    assert run(package) == (20.0, 1)
    (package / "c.py").write_text("FACTOR = 60.0\n")
    assert run(package) == (60.0, 0)
    (package / "unrelated.py").write_text("x = 2\n")
    assert run(package) == (60.0, 1)


def test_a_kernel_of_an_argument_whose_class_is_gone_is_compiled_anew(package: Path) -> None:
    """Regression: after a renamed class, reading the index of before raised in every flight."""
    source = (
        "import numba as nb\nfrom typing import NamedTuple\nclass Old(NamedTuple):\n    x: float\n"
        "@nb.njit(cache=True)\ndef inner(pair): return 2.0 * pair.x\n"
        "def call(x): return inner(Old(x))\ncall.stats = inner.stats\nkernel = call\n"
    )
    (package / "a.py").write_text(source)
    assert run(package) == (2.0, 0)
    (package / "a.py").write_text(source.replace("Old", "New"))
    assert run(package) == (2.0, 0)
    assert run(package) == (2.0, 1)
    kept = [file.name for file in (package / "__pycache__").glob("a.*.nbi")]
    assert len(kept) == 1, kept


def test_our_kernels_are_kept_by_our_locator() -> None:
    assert isinstance(geometry.wrap_angle._cache._impl.locator, kernel_cache.KernelLocator)


def test_a_stamp_covers_what_a_file_imports() -> None:
    imported = kernel_cache._imports(PACKAGE / "geometry.py")
    assert PACKAGE / "arrays.py" in imported
    assert kernel_cache.source_stamp(PACKAGE / "geometry.py") != kernel_cache.source_stamp(
        PACKAGE / "arrays.py"
    )


def test_a_read_only_package_keeps_its_kernels_elsewhere(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    usable = kernel_cache._usable
    monkeypatch.setattr(
        kernel_cache, "_usable", lambda folder: folder.name != "__pycache__" and usable(folder)
    )
    locator = kernel_cache.KernelLocator.from_function(geometry.wrap_angle.py_func, geometry.__file__)
    assert locator is not None
    assert Path(locator.get_cache_path()).is_relative_to(tmp_path)


def test_kernels_of_others_are_left_to_numba() -> None:
    locator = kernel_cache.KernelLocator.from_function(run, __file__)
    assert type(locator).__module__ == "numba.core.caching"

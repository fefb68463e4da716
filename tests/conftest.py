"""What all tests share: property tests that draw the same everywhere, and one small flown study."""

from __future__ import annotations

import contextlib
import json
import os
import shutil
import signal
import tempfile
from pathlib import Path
from subprocess import CalledProcessError

import pytest
from hypothesis import settings

from tests.folders import DATA
from tests.golden.flights import FLOWN, fly_apart
from uavexp.__main__ import main
from uavexp.store.study import STUDY, Study, read_study

# a failure in one clone is one in all, and a slow machine is none
settings.register_profile("same_everywhere", derandomize=True, deadline=None)
settings.load_profile("same_everywhere")


STORED = DATA / "study"
_SMALL = (
    "experiments=mcr/table1",
    "arm=SSP,TBR,MCR",
    "scene=columns sparse,rooms",
    "seed=0:2",
    "vehicle=point_mass",
    "world.size_m=[10,8,3]",
    "stuck_s=8",
)


def pytest_sessionstart(session: pytest.Session) -> None:
    """Before several processes share all tests: the golden flights, which compile the kernels for all."""
    whole = session.config.args_source is pytest.Config.ArgsSource.TESTPATHS
    shared = session.config.getoption("numprocesses", None) and not hasattr(session.config, "workerinput")
    if whole and shared:
        file = Path(tempfile.mkdtemp(prefix="uavexp-golden-")) / "flown.json"
        session.config.add_cleanup(lambda: shutil.rmtree(file.parent))
        with contextlib.suppress(CalledProcessError):  # their test tells
            file.write_text(json.dumps(fly_apart()), encoding="utf-8")
            os.environ[FLOWN] = str(file)  # the processes inherit it


@pytest.fixture(scope="session", autouse=True)
def _own_cache(tmp_path_factory: pytest.TempPathFactory) -> None:
    """Tests neither read nor fill the user's cache of worlds."""
    os.environ["XDG_CACHE_HOME"] = str(tmp_path_factory.mktemp("cache"))


@pytest.fixture(scope="session", autouse=True)
def _heard() -> None:
    """Tests that were started with & leave Ctrl-C to be heard by what they start."""
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture(scope="session")
def flown(tmp_path_factory: pytest.TempPathFactory) -> Study:
    """A study with logs and worlds: the one in `tests/data`, else twelve short flights."""
    folder = tmp_path_factory.getbasetemp() / "small-study"
    if not folder.exists():
        if (STORED / STUDY).is_file():
            shutil.copytree(STORED, folder)
        else:
            assert main([*_SMALL, f"out={folder}"]) == 0
    return read_study(folder)

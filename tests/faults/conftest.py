"""One small study with records, logs and a world, flown once, to be damaged in copies."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.sweeps import QUICK
from uavexp.__main__ import main


@pytest.fixture(scope="session")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("recorded") / "study"
    assert main([*QUICK, "strategy=mcr,tbr", "seed=0", f"out={folder}"]) == 0
    return folder

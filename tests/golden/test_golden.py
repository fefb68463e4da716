"""Flights are what they were, byte for byte."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import pytest

from tests.golden.flights import DIGESTS, FLIGHTS, FLOWN, fly_apart

TOP_MPS = 2.5  # of every vehicle flown
NOISE_MPS = 0.01
KEPT = json.loads(DIGESTS.read_text(encoding="utf-8"))


@pytest.fixture(scope="module")
def flown() -> dict[str, dict[str, Any]]:
    if FLOWN in os.environ:
        return json.loads(Path(os.environ[FLOWN]).read_text(encoding="utf-8"))
    return fly_apart()


def test_every_flight_has_its_digest() -> None:
    assert list(KEPT) == list(FLIGHTS)


@pytest.mark.parametrize("name", FLIGHTS)
def test_flight_is_what_it_was(flown: dict[str, dict[str, Any]], name: str) -> None:
    assert flown[name] == KEPT[name], "a change of numbers? name it in CHANGELOG, then: make golden"


@pytest.mark.parametrize("name", FLIGHTS)
def test_flown_speed_stays_below_the_limit_by_more_than_noise(name: str) -> None:
    assert 0.0 < KEPT[name]["top_mps"] < TOP_MPS - NOISE_MPS

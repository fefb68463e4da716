"""CI's share of `make fuzz`: the same kinds, fewer of each."""

from __future__ import annotations

import random
from collections import Counter
from pathlib import Path

import pytest

from tests.fuzz import commands, flights
from tests.fuzz.watch import in_time
from uavexp.config.composition import Composer

COMMANDS, FLIGHTS = 1000, 200


@pytest.fixture(scope="module")
def composer() -> Composer:
    return Composer(many=True)


def test_any_command_is_composed_or_refused_in_one_line(composer: Composer) -> None:
    outcomes = Counter[bool]()
    for seed in range(COMMANDS):
        with in_time(60.0):
            command, faults = commands.faults_of(composer, commands.drawn(composer, random.Random(seed)))
        assert faults == []
        outcomes[command is not None] += 1
    assert min(outcomes[True], outcomes[False]) > COMMANDS // 10, "both ends are reached"


def test_any_short_flight_ends_finite_or_is_refused(composer: Composer, tmp_path: Path) -> None:
    place = tmp_path / "place"
    ended = list(flights.fly(composer, FLIGHTS, 100, place))
    assert [fault for _, faults in ended for fault in faults] == []
    assert len(ended) == FLIGHTS
    assert sum(status == "ok" for status, _ in ended) > FLIGHTS // 2
    assert not place.exists(), "a job writes nothing"

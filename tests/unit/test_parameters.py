"""An option's parameters: declared once, checked when it is made, written to its yaml."""

from __future__ import annotations

import dataclasses
import math
from typing import Annotated

import pytest

from uavexp.config.generate import parameter_lines
from uavexp.errors import ConfigError, require
from uavexp.parameters import (
    Count,
    NonNegative,
    Positive,
    Range,
    Share,
    Unknown,
    Vector,
    above,
    at_most,
    is_option,
    option,
)


@dataclasses.dataclass(slots=True, kw_only=True)
class Shared:
    rate_hz: Positive = 10.0  # Hz, of both


@option
class Radar(Shared):
    path: str  # of a file
    rate_hz: Positive = 5.0
    share: Share = 0.5  # of something,
    # told in two lines
    count: Count = 3  # things
    gap_s: NonNegative | None = None  # s
    sizes_m: Range = (0.5, 1.0)  # m
    offset_m: Vector = (0.0, 0.0, 0.0)  # m
    tilt_rad: Annotated[float, above(0), at_most(1.2)] = 0.6  # rad
    unknown: Unknown = Unknown.OPTIMISTIC  # space
    _turns: int = dataclasses.field(init=False, default=0)  # no parameter

    def __post_init__(self) -> None:
        require(self.share < self.rate_hz, f"share must be < rate_hz = {self.rate_hz}, got {self.share}")


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"rate_hz": -1.0}, "rate_hz must be > 0 and finite, got -1.0"),
        ({"rate_hz": math.inf}, "rate_hz must be > 0 and finite, got inf"),
        ({"rate_hz": math.nan}, "rate_hz must be > 0 and finite, got nan"),
        ({"rate_hz": "fast"}, "rate_hz must be a number, got 'fast'"),
        ({"share": 1.5}, "share must be 0 to 1, got 1.5"),
        ({"count": 0}, "count must be >= 1, got 0"),
        ({"count": 1.5}, "count must be a whole number, got 1.5"),
        ({"gap_s": -1.0}, "gap_s must be >= 0 and finite, got -1.0"),
        ({"gap_s": "long"}, "gap_s must be a number or null, got 'long'"),
        ({"sizes_m": [2.0, 1.0]}, "sizes_m must be [least, greatest], got [2.0, 1.0]"),
        ({"sizes_m": [0.0, 1.0]}, "sizes_m[0] must be > 0 and finite, got 0.0"),
        ({"offset_m": [0.0, math.inf, 0.0]}, "offset_m[1] must be finite, got inf"),
        ({"offset_m": [0.0, 0.0]}, "offset_m must be [a number, a number, a number], got [0.0, 0.0]"),
        ({"tilt_rad": 1.3}, "tilt_rad must be > 0 and <= 1.2, got 1.3"),
        ({"unknown": "daring"}, "unknown must be optimistic | conservative, got 'daring'"),
        ({"share": 0.5, "rate_hz": 0.25}, "share must be < rate_hz = 0.25, got 0.5"),
    ],
)
def test_what_is_out_of_bounds_is_refused_in_words(given: dict[str, object], message: str) -> None:
    with pytest.raises(ConfigError) as refused:
        Radar(path="a", **given)
    assert str(refused.value) == message


def test_values_come_out_in_their_declared_types() -> None:
    radar = Radar(path="a", rate_hz=2, sizes_m=[1, 2], unknown="conservative")
    assert (type(radar.rate_hz), radar.sizes_m, radar.unknown) == (float, (1.0, 2.0), Unknown.CONSERVATIVE)


def test_a_frozen_option_is_checked_and_does_not_change() -> None:
    @option(frozen=True)
    class Rule:
        count: Count = 1

    with pytest.raises(ConfigError, match="count must be >= 1"):
        Rule(count=0)
    with pytest.raises(dataclasses.FrozenInstanceError):
        Rule().count = 2


def test_what_only_inherits_from_an_option_is_none() -> None:
    class Special(Radar):
        pass

    assert [is_option(item) for item in (Radar, Special, Shared, Radar(path="a"))] == [
        True,
        False,
        False,
        False,
    ]


def test_a_yaml_line_has_the_default_and_the_whole_comment() -> None:
    """A base's comment stands where an option only changes the default."""
    assert parameter_lines(Radar) == [
        "rate_hz: 5.0  # Hz, of both",
        "path: ???  # of a file",
        "share: 0.5  # of something, told in two lines",
        "count: 3  # things",
        "gap_s: null  # s",
        "sizes_m: [0.5, 1.0]  # m",
        "offset_m: [0.0, 0.0, 0.0]  # m",
        "tilt_rad: 0.6  # rad",
        "unknown: ${unknown}  # space",
    ]

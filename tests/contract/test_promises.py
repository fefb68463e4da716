"""Every option of every group keeps its group's promises; options are found by glob."""

from __future__ import annotations

import functools

import pytest

from tests.folders import DATA
from uavexp.check.promise import Make, breach, promises
from uavexp.check.subject import lacking, subjects
from uavexp.config.build import GROUPS
from uavexp.config.composition import Composer
from uavexp.config.overrides import parse_settings

COMPOSER = Composer()
OPTIONS = [(group, option) for group in GROUPS for option in COMPOSER.options[group]]


@pytest.fixture(scope="module")
def given(tmp_path_factory: pytest.TempPathFactory) -> dict[str, list[str]]:
    """Settings in place of a parameter that has no default."""
    people = tmp_path_factory.mktemp("given") / "people.csv"
    rows = [f"{0.4 * k:.1f},{p},{4.0 + 0.3 * p},{0.2 * k}" for p in range(3) for k in range(40)]
    people.write_text("\n".join(["t_s,id,x_m,y_m", *rows]) + "\n")
    flat = ["least_distance_m=4", f"path={DATA / 'flat.ply'}"]
    return {
        "movers.path": [f"movers.path={people}", "movers.begin_s=0.0"],
        "world.path": [f"world.{setting}" for setting in flat],
    }


@functools.cache
def made_by(*settings: str) -> Make:
    """One maker an option: what its promises have in common is asked once."""
    (subject,) = subjects(COMPOSER, parse_settings(list(settings)))
    assert subject.make is not None
    return subject.make


@pytest.mark.parametrize(
    ("group", "option", "promise"),
    [(group, option, promise) for group, option in OPTIONS for promise in promises(group)],
)
def test_an_option_keeps_its_promises(
    group: str, option: str, promise: str, given: dict[str, list[str]]
) -> None:
    settings = [item for name in lacking(COMPOSER, group, option) for item in given[name]]
    assert breach(promises(group)[promise], made_by(f"{group}={option}", *settings)) == ""

"""Every option of every group keeps its group's promises; options are found by glob."""

from __future__ import annotations

import functools
from pathlib import Path

import pytest

from uavexp.check.promise import breach, promises
from uavexp.check.subject import Subject, subjects
from uavexp.config.build import GROUPS
from uavexp.config.composition import Composer
from uavexp.config.overrides import parse_settings
from uavexp.paths import conf_folder

CHECKED = [group for group in GROUPS if (Path(__file__).parents[2] / f"uavexp/check/{group}.py").is_file()]


@functools.cache
def composer() -> Composer:
    return Composer()


@functools.cache
def subject(group: str, option: str) -> Subject:
    (found,) = subjects(composer(), parse_settings([f"{group}={option}"]))
    return found


@pytest.mark.parametrize(
    ("group", "option", "promise"),
    [
        (group, file.stem, promise)
        for group in CHECKED
        for file in sorted((conf_folder() / group).glob("*.yaml"))
        for promise in promises(group)
    ],
)
def test_an_option_keeps_its_promises(group: str, option: str, promise: str) -> None:
    assert breach(promises(group)[promise], subject(group, option).make) == ""

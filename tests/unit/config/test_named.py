"""Settings from a file of one's own, and faults in one's own files, told with the file's name."""

from __future__ import annotations

from pathlib import Path

import pytest

from uavexp.config.composition import Composer
from uavexp.config.named import with_named
from uavexp.config.overrides import parse_settings
from uavexp.errors import ConfigError

FILE = """
defaults:
  - config
  - override world: rooms
  - override /planner/find: voxel
  - _self_
strategy: mcr
trigger:
  delta_map_m: 0.2
seed: "0:3"
"""


def written(folder: Path, name: str, text: str) -> Path:
    file = folder / name
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(text)
    return folder


def test_a_file_means_what_typing_it_would_mean(tmp_path: Path) -> None:
    named = with_named("office", written(tmp_path, "office.yaml", FILE), [])
    typed = parse_settings(
        ["world=rooms", "planner.find=voxel", "strategy=mcr", "trigger.delta_map_m=0.2", "seed=0:3"]
    )
    assert Composer().command(named).cells == Composer().command(typed).cells
    assert Composer().command(named).seeds == (0, 1, 2)


def test_what_is_typed_wins(tmp_path: Path) -> None:
    folder = written(tmp_path, "office.yaml", FILE)
    settings = with_named("office", folder, parse_settings(["trigger.delta_map_m=0.4", "world=warehouse"]))
    (cell,) = Composer().command(settings).cells
    assert cell.options["world"] == "warehouse"
    assert cell.config["trigger"]["delta_map_m"] == 0.4


@pytest.mark.parametrize(
    ("name", "text", "told"),
    [
        ("offic", FILE, "did you mean 'office'"),
        ("office", "- a\n- b\n", "must be settings, KEY: VALUE"),
        ("office", "a: [", "cannot be read"),
        ("office", "defaults: [5]", "each is GROUP: OPTION"),
    ],
)
def test_a_file_that_is_none_is_one_line(tmp_path: Path, name: str, text: str, told: str) -> None:
    with pytest.raises(ConfigError, match=told) as caught:
        with_named(name, written(tmp_path, "office.yaml", text), [])
    assert "\n" not in str(caught.value)


def test_a_name_needs_its_folder() -> None:
    with pytest.raises(ConfigError, match="--config-dir DIR"):
        with_named("office", None, [])


TBR = "_target_: uavexp.trigger.tbr.Tbr\n"


@pytest.mark.parametrize(
    ("file", "text", "typed", "told"),
    [
        ("trigger/mine.yaml", f"{TBR}interval: 2.0\n", "trigger=mine", "it stands in {file}"),
        ("trigger/mine.yaml", f"{TBR}interval_s: -2.0\n", "trigger=mine", "it stands in {file}"),
        ("triger/mine.yaml", TBR, "triger=mine", "is the folder of no group (did you mean 'trigger'?)"),
        ("triger/mine.yaml", TBR, "trigger=mine", "no such option (mine is in triger)"),
        (
            "strategy/mine.yaml",
            "# @package _global_\ndefaults:\n  - override /trigger: tbrr\n",
            "strategy=mine",
            "strategy=mine asks for trigger=tbrr: no such option (did you mean 'tbr'?)",
        ),
    ],
)
def test_a_fault_in_a_file_of_ones_own_is_told_with_its_place(
    tmp_path: Path, file: str, text: str, typed: str, told: str
) -> None:
    folder = written(tmp_path, file, text)
    with pytest.raises(ConfigError) as caught:
        Composer(user_folder=folder).command(parse_settings([typed]))
    assert told.format(file=folder / file) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_fault_that_was_typed_is_not_blamed_on_a_file(tmp_path: Path) -> None:
    folder = written(tmp_path, "trigger/mine.yaml", f"{TBR}interval_s: 2.0\n")
    with pytest.raises(ConfigError) as caught:
        Composer(user_folder=folder).command(parse_settings(["trigger=mine", "trigger.interval_s=-1"]))
    assert "stands in" not in str(caught.value)

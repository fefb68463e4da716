"""Configuration to components: types, ranges, rates and contradictions are told in one line."""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from pathlib import Path
from typing import Any, Literal

import pytest
from hypothesis import given
from hypothesis import strategies as st

from uavexp.config.build import GROUPS, build, top_level
from uavexp.config.composition import Cell, CommandLine, Composer
from uavexp.config.overrides import flatten, parse_settings
from uavexp.config.trust import VARIABLE
from uavexp.errors import ConfigError
from uavexp.parameters import check_value, describe, parameter_types, plain

COMPOSER = Composer()


def command(*typed: str, composer: Composer = COMPOSER) -> CommandLine:
    return composer.command(parse_settings(typed))


def cell(*typed: str) -> Cell:
    (only,) = command(*typed).cells
    return only


def refusal(*typed: str, composer: Composer = COMPOSER) -> str:
    with pytest.raises(ConfigError) as error:
        command(*typed, composer=composer)
    text = str(error.value)
    assert "\n" not in text
    return text


class Colour(StrEnum):
    RED = "red"
    BLUE = "blue"


@pytest.mark.parametrize(
    ("value", "annotation", "expected"),
    [
        (5, float, 5.0),
        (True, bool, True),
        (3.0, int, 3),
        (None, float | None, None),
        (2, float | None, 2.0),
        ("red", Colour, Colour.RED),
        ([1, 2, 3], tuple[float, float, float], (1.0, 2.0, 3.0)),
        ([1, 2], tuple[float, ...], (1.0, 2.0)),
        ([[1, 2, 3], [4, 5, 6]], list[list[float]], [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]),
        ([1], Sequence[float], [1.0]),
        ({"a": 1}, dict[str, float], {"a": 1.0}),
        ("z", Literal["x", "z"], "z"),
        ("anything", Any, "anything"),
    ],
)
def test_a_value_comes_out_in_its_annotated_type(value: object, annotation: Any, expected: object) -> None:
    converted = check_value("name", value, annotation)
    assert converted == expected
    assert type(converted) is type(expected)


@pytest.mark.parametrize(
    ("value", "annotation"),
    [
        ("fast", float),
        ("1.0", float),
        (True, float),
        (math.nan, float),
        (math.nan, int),
        (math.inf, int),
        (1.5, int),
        (True, int),
        (1, bool),
        ("true", bool),
        (3, str),
        (None, float),
        ("green", Colour),
        ([1, 2], tuple[float, float, float]),
        ([1, 2, 3, 4], tuple[float, float, float]),
        (["x"], list[float]),
        (1.0, list[float]),
        ("abc", Sequence[str]),
        ("y", Literal["x", "z"]),
        ({"a": "b"}, dict[str, float]),
        ([1, math.nan, 3], tuple[float, ...]),
    ],
)
def test_a_value_of_another_type_is_refused_with_what_is_allowed(value: object, annotation: Any) -> None:
    with pytest.raises(ConfigError) as error:
        check_value("group.name", value, annotation)
    assert str(error.value) == f"group.name must be {describe(annotation)}, got {value!r}"


@given(st.floats(allow_nan=False))
def test_checking_twice_changes_nothing(value: float) -> None:
    once = check_value("x", value, float)
    assert check_value("x", plain(once), float) == once


def test_only_constructor_parameters_are_parameters() -> None:
    @dataclass(slots=True, kw_only=True)
    class Part:
        rate_hz: float = 1.0
        _state: int = field(init=False, default=0)

    assert parameter_types(Part) == {"rate_hz": float}


def test_5_and_5_0_are_the_same_configuration() -> None:
    assert cell("sensor.max_range_m=5").config == cell("sensor.max_range_m=5.0").config
    assert set(cell().config) == {*GROUPS, *top_level()}


def test_a_checked_configuration_builds_again() -> None:
    parts = build(cell("latency_s=0.05").config)
    assert parts.latency_s == 0.05


@pytest.mark.parametrize(
    ("typed", "words"),
    [
        ("strategy=mrc", ["strategy=mrc", "did you mean 'mcr'", "tbr"]),
        ("world=warehose", ["did you mean 'warehouse'"]),
        ("trigr=mcr", ["unknown key 'trigr'", "did you mean 'trigger'"]),
        ("trigger.delta_mapm=0.1", ["no parameter 'delta_mapm'", "did you mean 'delta_map_m'"]),
        ("+trigger.nonsense=1", ["nonsense", "it has"]),
        ("trigger.delta_map_m.x=1", ["no parts"]),
        ("sensor.rate_hz=fast", ["sensor.rate_hz must be a number, got 'fast'"]),
        ("sensor.rate_hz=nan", ["sensor.rate_hz", "nan"]),
        ("sensor.rate_hz=-20", ["sensor.rate_hz must be > 0", "-20"]),
        ("sensor.rate_hz=0", ["sensor.rate_hz must be > 0"]),
        ("sensor.rate_hz=30", ["sensor.rate_hz", "whole multiple of step_s"]),
        ("mapping.esdf_rate_hz=7", ["mapping.esdf_rate_hz", "whole multiple"]),
        ("latency_s=0.025", ["latency_s", "whole multiple of step_s"]),
        ("latency_s=-0.01", ["latency_s must be >= 0"]),
        ("step_s=0", ["step_s must be 0.0001 to 0.1"]),
        ("step_s=ten", ["step_s must be a number, got 'ten'"]),
        ("sensor.axial_noise=1", ["true or false"]),
        ("world.size_m=20,12,3", ["world.size_m", "got 20"]),
        ("world.size_m=[20,12]", ["world.size_m", "[20"]),
        ("trigger.judge=pth", ["trigger.judge", "path | region"]),
        (
            "mapping.max_distance_m=1.0",
            ["trigger.monitor_radius_m must be <=", "max_distance_m = 1.0, got 2.0"],
        ),
        ("mission=explore explorer=target_only", ["mission: explore has no target"]),
        ("world=file", ["world.path must be given", "world.path=VALUE"]),
        ("strategy=mcr trigger=tbr", ["contradicts"]),
        (
            "experiments=mcr/tabel1",
            ["no such experiment: mcr/tabel1 (did you mean 'mcr/table1'?), available: "],
        ),
        ("planner=null", ["planner=null: no such option", "bspline_mpc"]),
        ("out=a,b", ["out must be one folder"]),
        ("out=3", ["out must be one folder"]),
        ("seed=0 out=''", ["out must be one folder"]),
        ("trigger.delta_map_m=0.1,0.10", ["the same configuration twice"]),
        ("strategy=mcr,tbr trigger.interval_s=1,2", ["option mcr of trigger", "only tbr has"]),
        ("sensor.rate_hz=${oc.env:HOME}", ["no ${resolver:...}"]),
        ("sensor.rate_hz=${oc.decode:'1'}", ["no ${resolver:...}"]),
        ("world.size_m=[${now:%Y},5,3]", ["no ${resolver:...}"]),
        ("sensor.rate_hz=${nowhere}", ["nowhere"]),
        ("sensor={_target_: os.system}", ["sensor._target_='os.system' is refused"]),
        ("+sensor.x={_target_: os.system}", ["refused"]),
        ("+sensor.x=[{(): os.system}]", ["refused|quote"]),
        ("++mission.deep=[[{_target_: builtins.eval}]]", ["builtins.eval", "refused"]),
        ("sensor._target_=uavexp.world.rooms.Rooms", ["is no option of sensor"]),
        ("sensor._target_=${planner._target_}", ["is no option of sensor"]),
        ("safety={_target_: uavexp.config.trust.os.system}", ["is no option of safety"]),
    ],
)
def test_bad_input_is_one_line_that_says_what_and_what_is_allowed(typed: str, words: list[str]) -> None:
    parts = typed.split(" ") if not typed.count("{") else [typed]
    text = refusal(*parts)
    for word in words:
        assert any(choice in text for choice in word.split("|")) or word in text, text


def test_seeds_are_checked_before_anything_is_composed() -> None:
    assert "given twice" in refusal("seed=1,1", "world=file")


def test_a_grid_is_every_combination_the_first_axis_slowest() -> None:
    cells = command("strategy=mcr,tbr", "world.flight_height_m=1.0,1.1,1.2").cells
    assert [(item.strategy, item.config["world"]["flight_height_m"]) for item in cells] == [
        (strategy, height) for strategy in ("mcr", "tbr") for height in (1.0, 1.1, 1.2)
    ]


def test_a_value_typed_wins_over_the_preset() -> None:
    assert cell("strategy=mcr_literal").config["trigger"]["judge"] == "region"
    assert cell("strategy=mcr_literal", "trigger.judge=path").config["trigger"]["judge"] == "path"


def test_a_trigger_typed_names_the_strategy() -> None:
    assert cell("trigger=tbr").strategy == "tbr"
    assert cell("strategy=mcr_literal", "trigger=mcr").strategy == "mcr_literal"


def test_safety_none_is_an_option_and_not_nothing() -> None:
    assert cell("safety=none").options["safety"] == "none"
    assert cell().options["safety"] == "none"


def test_keywords_mean_what_the_command_line_means() -> None:
    settings = [item for key, value in {"world.size_m": [8, 6, 3]}.items() for item in flatten(key, value)]
    assert settings == parse_settings(["world.size_m=[8,6,3]"])


PLANNER = """
class {name}:
    def __init__(self, reach_m: float = 1.0) -> None:
        if reach_m <= 0.0:
            raise ValueError("reach_m must be > 0 m")
        self.reach_m = reach_m
    def reset(self, limits, rng): ...
{plan}
"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A user's package `mine_uavexp` and his options beside it."""
    package = tmp_path / "mine_uavexp"
    package.mkdir()
    (package / "__init__.py").write_text("")
    plan = "    def plan(self, request): ..."
    (package / "planners.py").write_text(
        PLANNER.format(name="Good", plan=plan) + PLANNER.format(name="Lacking", plan="")
    )
    options = tmp_path / "options" / "planner"
    options.mkdir(parents=True)
    for name in ("Good", "Lacking"):
        (options / f"{name.lower()}.yaml").write_text(
            f"_target_: mine_uavexp.planners.{name}\nreach_m: 2.0  # m\n"
        )
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.delenv(VARIABLE, raising=False)
    yield tmp_path / "options"  # type: ignore[misc]
    for name in [name for name in sys.modules if name.startswith("mine_uavexp")]:
        del sys.modules[name]


def test_a_user_s_planner_needs_his_word(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    composer = Composer(user_folder=folder)
    assert "mine_uavexp.planners.Good" in refusal("planner=good", composer=composer)
    assert "mine_uavexp" not in sys.modules, "refused before anything was imported"
    monkeypatch.setenv(VARIABLE, "mine_uavexp")
    (own,) = command("planner=good", "planner.reach_m=3", composer=composer).cells
    assert own.config["planner"] == {"_target_": "mine_uavexp.planners.Good", "reach_m": 3.0}


def test_a_user_s_planner_is_checked_like_ours(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(VARIABLE, "mine_uavexp")
    composer = Composer(user_folder=folder)
    assert "it lacks plan" in refusal("planner=lacking", composer=composer)
    assert "planner.reach_m must be a number" in refusal(
        "planner=good", "planner.reach_m=x", composer=composer
    )
    assert "reach_m must be > 0 m" in refusal("planner=good", "planner.reach_m=-1", composer=composer)


@pytest.mark.parametrize(
    ("group", "text"),
    [
        ("planner", "# @package _global_\nhydra:\n  callbacks:\n    x:\n      _target_: os.system\n"),
        ("planner", "# @package hydra.job_logging\nhandlers:\n  x:\n    (): os.system\n"),
        ("planner", "# @package hydra\nlauncher:\n  _target_: os.system\n"),
        (
            "planner",
            "defaults:\n  - override /hydra/launcher: basic\n_target_: uavexp.planner.min_acc.MinAcc\n",
        ),
        ("planner", "# @package _global_\nhydra:\n  searchpath: ['pkg://this']\n"),
        ("planner", "# @package _global_\nhydra:\n  job:\n    env_copy: [NOT_SET_ANYWHERE]\n"),
        ("planner", "_target_: uavexp.planner.min_acc.MinAcc\nx:\n  - - _target_: os.system\n"),
        ("planner", "_target_: ${oc.env:SHELL}\n"),
        ("planner", "_target_: ${world.name}\n"),
        ("planner", "_target_: uavexp.planner.min_acc.MinAcc\n_args_: [1]\n"),
        ("planner", "_target_: uavexp.planner.min_acc.MinAcc\n_partial_: true\n"),
        ("planner", "_target_: !!python/object/apply:os.system ['true']\n"),
        ("planner", "_target_: [broken\n"),
        ("planner", "- a\n- b\n"),
        ("planner", ""),
        ("planner", "reach_m: 1.0\n"),
        ("planner", "\x00\x01"),
        ("planner", "_target_: &a uavexp.planner.min_acc.MinAcc\n_target_: *b\n"),
    ],
)
def test_a_stranger_s_yaml_runs_nothing(
    tmp_path: Path, group: str, text: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv(VARIABLE, raising=False)
    called: list[str] = []
    monkeypatch.setattr("os.system", called.append)
    (tmp_path / group).mkdir()
    (tmp_path / group / "evil.yaml").write_text(text)
    refusal(f"{group}=evil", composer=Composer(user_folder=tmp_path))
    assert not called


def test_a_user_s_option_does_not_hide_behind_a_taken_name(tmp_path: Path) -> None:
    (tmp_path / "planner").mkdir()
    (tmp_path / "planner" / "min_acc.yaml").write_text("_target_: uavexp.planner.min_acc.MinAcc\n")
    with pytest.raises(ConfigError, match="planner=min_acc exists already"):
        Composer(user_folder=tmp_path)


def test_a_user_s_config_yaml_does_not_replace_ours(tmp_path: Path) -> None:
    (tmp_path / "config.yaml").write_text("hydra:\n  searchpath: ['pkg://this']\n")
    assert Composer(user_folder=tmp_path).command([]).cells[0].config == cell().config


def test_a_folder_with_odd_characters_is_found(tmp_path: Path) -> None:
    folder = tmp_path / "mine, (2) #1 'x' \\ ü"
    (folder / "planner").mkdir(parents=True)
    (folder / "planner" / "mine.yaml").write_text("_target_: uavexp.planner.min_acc.MinAcc\n")
    assert (
        command("planner=mine", composer=Composer(user_folder=folder)).cells[0].options["planner"] == "mine"
    )


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("trigger: {interval_s: 1.0}\n", ["strategy=mine sets nothing", "# @package _global_"]),
        ("# @package _global_\ntriger: {interval_s: 1.0}\n", ["unknown key 'triger'", "'trigger'"]),
    ],
)
def test_a_preset_that_sets_nothing_is_refused(tmp_path: Path, text: str, words: list[str]) -> None:
    """It used to fly the defaults under its own name."""
    (tmp_path / "strategy").mkdir()
    (tmp_path / "strategy" / "mine.yaml").write_text(text)
    told = refusal("strategy=mine", composer=Composer(user_folder=tmp_path))
    assert all(word in told for word in words), told

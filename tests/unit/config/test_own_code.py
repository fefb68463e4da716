"""Typical mistakes in a trigger of one's own: each is one line that says what to do."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

import uavexp
from tests.sweeps import QUICK
from uavexp.config.own_code import own_frame
from uavexp.errors import UavexpError
from uavexp.frames import portable_trace

TRIGGER = '''
from dataclasses import dataclass

import numpy as np
from uavexp.parameters import Positive, option
from uavexp.types import Decision


@option
class Odometer:
    """Never replans."""

    after_m: Positive = 2.0

    def reset(self, limits): ...
    def planned(self, trajectory, field): ...
    def decide(self, observation): return {decides}


class Forgetful:
    def reset(self, limits): ...
    def decide(self, observation): ...


class Narrow(Odometer):
    def planned(self, trajectory): ...


class Proud:
    def __init__(self):
        raise KeyError("pride")
'''
RIGHT = "Decision(replan=False)"
MISTAKES = {
    "returns the wrong type": (
        "Odometer", "True", "",
        "own_{n}.odometer.Odometer.decide must return a Decision (uavexp.types), got bool: True",
    ),
    "returns nothing": (
        "Odometer", "None", "",
        "own_{n}.odometer.Odometer.decide must return a Decision (uavexp.types), got NoneType: None",
    ),
    "misses a method": (
        "Forgetful", RIGHT, "",
        "own_{n}.odometer.Forgetful is no trigger, it lacks planned; write them as in uavexp/trigger/base.py",
    ),
    "takes other arguments": (
        "Narrow", RIGHT, "", "write def planned(self, trajectory: Trajectory, field: DistanceField) -> None",
    ),
    "raises when it is made": ("Proud", RIGHT, "", "KeyError: 'pride'; mend own_{n}/odometer.py:"),
    "is not in its module": (
        "Odometre", RIGHT, "", "defines no class Odometre (did you mean 'Odometer'?)",
    ),
    "does not compile": ("Odometer", "True False", "", "mend own_{n}/odometer.py:17: invalid syntax"),
    "raises when imported": (
        "Odometer", f"{RIGHT}\n\n\n1 / 0", "", "ZeroDivisionError: division by zero; mend own_{n}/",
    ),
    "imports what is missing": (
        "Odometer", f"{RIGHT}\nimport no_such_thing", "",
        "imports no_such_thing, which is not installed; install it or mend the import",
    ),
    "typo in a parameter": (
        "Odometer", RIGHT, "after_mm: 3.0", "has no parameter 'after_mm' (did you mean 'after_m'?)",
    ),
    "no yaml": ("Odometer", RIGHT, "after_m 3.0", "could not find expected ':'"),
    "wrong value": ("Odometer", RIGHT, "after_m: far", "trigger.after_m must be a number"),
}  # fmt: skip
TARGETS = {
    "no such module": (
        "{own}.odometre.Odometer", "there is no module {own}.odometre; is there {own}/odometre.py?",
    ),
    "no such package": (
        "{own}2.odometer.Odometer", "there is no package {own}2; start in the folder that holds {own}2/",
    ),
    "another role's class": ("uavexp.planner.astar.AStar", "name a class of uavexp.trigger or of your own"),
    "a function": ("uavexp.trigger.mcr.dataclass", "defines no class dataclass"),
}  # fmt: skip


def told(
    monkeypatch: pytest.MonkeyPatch, folder: Path, own: str, target: str, more: str, decides: str
) -> str:
    """What is said to a project with this trigger, which must be one line."""
    (folder / own).mkdir()
    (folder / own / "__init__.py").touch()
    (folder / own / "odometer.py").write_text(TRIGGER.replace("{decides}", decides))
    (folder / "conf" / "trigger").mkdir(parents=True)
    (folder / "conf" / "trigger" / "odometer.yaml").write_text(f"_target_: {target}\n{more}\n")
    monkeypatch.setenv("UAVEXP_TRUST", f"{own},{own}2")
    monkeypatch.syspath_prepend(folder)
    with pytest.raises(UavexpError) as caught:
        uavexp.fly(*QUICK, trigger="odometer", config_dir=folder / "conf")
    assert str(caught.value).count("\n") == 0
    return str(caught.value)


@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_mistake_in_a_class_is_told(mistake: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    name, decides, more, words = MISTAKES[mistake]
    number = [*MISTAKES].index(mistake)
    own = f"own_{number}"  # a module is imported once in a process
    said = told(monkeypatch, tmp_path, own, f"{own}.odometer.{name}", more, decides)
    assert words.replace("{n}", str(number)) in said


@pytest.mark.parametrize("mistake", TARGETS)
def test_a_mistake_in_a_target_is_told(mistake: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    target, words = TARGETS[mistake]
    own = f"target_{[*TARGETS].index(mistake)}"
    said = told(monkeypatch, tmp_path, own, target.format(own=own), "", RIGHT)
    assert words.format(own=own) in said


def test_a_file_without_a_class_names_the_word_meant(tmp_path: Path) -> None:
    (tmp_path / "trigger").mkdir()
    (tmp_path / "trigger" / "odometer.yaml").write_text("_targt_: mine.odometer.Odometer\n")
    with pytest.raises(UavexpError, match=r"is _targt_ meant\?.*its file begins _target_: PACKAGE\.MODULE"):
        uavexp.fly(*QUICK, trigger="odometer", config_dir=tmp_path)


def test_the_frame_shown_is_the_last_in_a_package_of_ones_own(monkeypatch: pytest.MonkeyPatch) -> None:
    frames = ["uavexp/trial.py:1 fly", "mine/a/b.py:2 decide", "numpy/linalg.py:3 norm"]
    monkeypatch.setenv("UAVEXP_TRUST", "mine")
    assert own_frame(frames) == frames[1]
    assert own_frame(["uavexp/a.py:1 x", "mine.py:7 decide", "numpy/b.py:2 y"]) == "mine.py:7 decide"
    monkeypatch.setenv("UAVEXP_TRUST", "min")
    assert own_frame(frames) == frames[2], "another package"


def test_a_frame_is_named_from_the_folder_that_python_found_it_in(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "deep" / "inner").mkdir(parents=True)
    (tmp_path / "deep" / "inner" / "raising.py").write_text("def go():\n    raise ValueError\n")
    monkeypatch.syspath_prepend(tmp_path)
    import deep.inner.raising as raising  # type: ignore[import-not-found]

    try:
        raising.go()
    except ValueError as error:
        trace = portable_trace(error)
    assert trace[-1] == "deep/inner/raising.py:2 go: raise ValueError"
    assert not any(str(tmp_path) in frame or sys.prefix in frame for frame in trace)

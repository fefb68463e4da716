"""Files of a user's folder, whatever is in them: one line before a flight; help never dies of one."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from uavexp.cli.helptext import help_text
from uavexp.config.composition import Composer
from uavexp.config.overrides import parse_settings
from uavexp.errors import ConfigError

ARM = b"axes: {arm: {x: {strategy: mcr}}}\n"
FILES = {
    "latin": b'title: "\xe9"\n' + ARM,
    "set": b"settings: {s: !!set {a, b}}\n" + ARM,
    "binary": b'settings: {s: !!binary "aGVsbG8="}\n' + ARM,
    "holds_itself": b"settings: &x {a: *x}\n" + ARM,
    "deep": b"settings: " + b"[" * 2000 + b"]" * 2000 + b"\n" + ARM,
    "own_axis": b"axes: {arm: a/own_axis}\n",
    "list_as_key": b"? [a, b]\n: c\n" + ARM,
    "noise": bytes(range(256)),
    "twice": ARM + ARM,
    "empty": b"",
}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "experiments" / "a").mkdir(parents=True)
    (tmp_path / "strategy").mkdir()
    for name, content in FILES.items():
        (tmp_path / "experiments" / "a" / f"{name}.yaml").write_bytes(content)
        (tmp_path / "strategy" / f"own_{name}.yaml").write_bytes(b"# @package _global_\n" + content)
    for group in ("experiments/a", "strategy"):
        (tmp_path / group / "a_folder.yaml").mkdir()
        os.mkfifo(tmp_path / group / "fifo.yaml")  # a reader of it would wait for ever
        (tmp_path / group / "zero.yaml").symlink_to("/dev/zero")
    return tmp_path


@pytest.mark.parametrize("name", [*FILES, "a_folder", "fifo", "zero"])
def test_an_experiment_that_is_none_is_one_line(name: str, folder: Path) -> None:
    with pytest.raises(ConfigError, match=r"experiments=a/|no such experiment"):
        Composer(user_folder=folder).command(parse_settings([f"experiments=a/{name}"]))


@pytest.mark.parametrize("name", ["own_holds_itself", "own_deep", "own_latin", "own_noise", "fifo", "zero"])
def test_a_preset_that_is_none_is_one_line(name: str, folder: Path) -> None:
    with pytest.raises(ConfigError):
        Composer(user_folder=folder).command(parse_settings([f"strategy={name}"]))


@pytest.mark.parametrize("group", [None, "strategy"])
def test_help_is_given_beside_any_file(group: str | None, folder: Path) -> None:
    text = help_text(folder, group)
    assert "own_latin" in text
    assert "fifo" not in text

"""Files of a user's folder, whatever is in them: one line before a flight; help never dies of one."""

from __future__ import annotations

import os
from pathlib import Path
from typing import NoReturn

import pytest

from uavexp.cli.helptext import help_text
from uavexp.config.composition import Composer
from uavexp.config.files import yaml_files
from uavexp.config.named import with_named
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


LAUGHS = "a0: &a0 [x, x, x, x]\n" + "".join(
    f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 9)}]\n" for i in range(1, 12)
)


@pytest.mark.parametrize("place", ["trigger/mine.yaml", "experiments/a/mine.yaml", "mine.yaml"])
def test_aliases_that_would_unpack_to_billions_are_refused_at_once(place: str, tmp_path: Path) -> None:
    file = tmp_path / place
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(LAUGHS)
    typed = {"trigger": "trigger=mine", "experiments": "experiments=a/mine"}.get(place.split("/")[0])
    with pytest.raises(ConfigError, match="its aliases unpack to more than 100000 values"):  # noqa: PT012
        settings = parse_settings([typed]) if typed else with_named("mine", tmp_path, [])
        Composer(user_folder=tmp_path).command(settings)


def test_a_few_aliases_are_a_way_to_write(tmp_path: Path) -> None:
    (tmp_path / "experiments" / "a").mkdir(parents=True)
    text = "axes: {arm: {x: &x {strategy: mcr}, y: {stuck_s: 9.0}}, again: {z: *x}}\n"
    (tmp_path / "experiments" / "a" / "mine.yaml").write_text(text)
    assert len(Composer(user_folder=tmp_path).command(parse_settings(["experiments=a/mine"])).cells) == 2


def test_a_folder_that_cannot_be_searched_is_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of /proc, whose folders come and go, the system refuses some."""

    def refused(folder: Path, pattern: str) -> NoReturn:
        raise OSError(22, "Invalid argument", str(folder))

    monkeypatch.setattr(Path, "glob", refused)
    with pytest.raises(ConfigError, match="is no folder of configurations"):
        yaml_files(tmp_path, "*.yaml")

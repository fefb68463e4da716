"""Which config groups, options and parameters exist, read from the yaml files as text."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from uavexp.config.files import yaml_files
from uavexp.errors import ConfigError
from uavexp.paths import expanded

PRESET_GROUP = "strategy"  # only overrides other groups; has no component
EXPERIMENT_GROUP = "experiments"  # files of their own, see `uavexp.config.experiment`
RUNNER_GROUP = "runner"  # how trials are run: no part of a trial
_MOST_BYTES = 1_000_000  # of a file, that help looks at
_PARAMETER = re.compile(r"^(?P<name>[A-Za-z_]\w*):\s*(?P<value>.*?)\s*(?:\s#\s*(?P<comment>.*))?$")


@dataclass(frozen=True, slots=True, kw_only=True)
class Parameter:
    """One line of an option's yaml."""

    name: str
    default: str
    comment: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Option:
    """One yaml file, taken apart as text (never executed, never resolved)."""

    description: str
    parameters: tuple[Parameter, ...]


def user_folder(path: str) -> Path:
    """Absolute folder given by `--config-dir`, checked to exist."""
    folder = expanded(path).resolve()
    if not folder.is_dir():
        raise ConfigError(f"--config-dir {path}: no such folder")
    return folder


def list_options(folders: Sequence[Path]) -> dict[str, dict[str, Path]]:
    """Yaml file of every option of every group; those that a planner holds are groups like planner.find.

    Raises:
        ConfigError: a user's folder has an option whose name is taken (the shipped one
            would win silently).
    """
    found: dict[str, dict[str, Path]] = {}
    for folder in folders:
        for file in yaml_files(folder, "*/*.yaml", "*/*/*.yaml"):
            group = ".".join(file.parent.relative_to(folder).parts)
            if group.split(".")[0] == EXPERIMENT_GROUP:
                continue
            options = found.setdefault(group, {})
            if file.stem in options:
                raise ConfigError(f"{file}: {group}={file.stem} exists already; rename yours")
            options[file.stem] = file
    return found


def text_of(file: Path) -> str:
    """A configuration's text for people; what is no text in it, whatever its encoding, harms nothing."""
    try:
        with file.open("rb") as opened:
            return opened.read(_MOST_BYTES).decode(errors="replace")
    except OSError as error:
        raise ConfigError(f"{file} cannot be read: {error.strerror}") from error


def place_in(files: Sequence[Path], message: str, typed: Sequence[str]) -> str:
    """In which of the files the key that a message begins with stands, in words; none if it was typed."""
    key = message.split(" ")[0].rstrip(":")
    word = re.compile(rf"\b{re.escape(key.rpartition('.')[2])}\b")
    there = [file for file in files if key not in typed and word.search(text_of(file))]
    return "".join(f"; it stands in {file}" for file in there)


def read_option(file: Path) -> Option:
    """Description (leading comment) and parameters of one yaml file."""
    description: list[str] = []
    parameters: list[Parameter] = []
    for line in text_of(file).splitlines():
        match = _PARAMETER.match(line)
        if match is None:
            if line.startswith("#") and not parameters and not line.startswith("# @package"):
                description.append(line.lstrip("# ").rstrip())
        elif match["name"] not in ("_target_", "defaults"):
            parameters.append(
                Parameter(name=match["name"], default=match["value"], comment=match["comment"] or "")
            )
    return Option(description=" ".join(description), parameters=tuple(parameters))

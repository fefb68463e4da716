"""Completion offers what there is, and bash takes it as a person's key does."""

from __future__ import annotations

import subprocess
import sys

import pytest

from uavexp.cli.completion import candidates, completion
from uavexp.config.experiment import list_experiments
from uavexp.config.options import list_options
from uavexp.errors import ConfigError
from uavexp.paths import conf_folder


def test_groups_options_parameters_and_experiments_are_offered_as_they_are() -> None:
    options = list_options([conf_folder()])
    assert {f"{group}=" for group in options} <= set(candidates(""))
    assert candidates("trigger=") == [f"trigger={name}" for name in options["trigger"]]
    assert candidates("trigger=mcr,t") == ["trigger=mcr,tbr"]
    assert candidates("trigger.delta_m") == ["trigger.delta_map_m="]
    assert candidates("experiments=mcr/") == [
        f"experiments={name}" for name in list_experiments() if name.startswith("mcr/")
    ]
    assert candidates("nothing") == []


@pytest.mark.parametrize(
    ("typed", "offered"), [("trigger=tb", "tbr"), ("strat", "strategy="), ("--he", "--help")]
)
def test_bash_completes_a_word(typed: str, offered: str) -> None:
    line = f"uavexp {typed}"
    script = f"""{completion("install=bash")}
uavexp() {{ {sys.executable} -m uavexp "$@"; }}
COMP_LINE='{line}' COMP_POINT={len(line)}
_uavexp
printf '%s\\n' "${{COMPREPLY[@]}}"
"""
    run = subprocess.run(["bash", "-c", script], capture_output=True, text=True, check=True)
    assert run.stdout.split() == [offered]


def test_another_request_is_told() -> None:
    with pytest.raises(ConfigError, match="type -sc install=bash"):
        completion("install=tcsh")

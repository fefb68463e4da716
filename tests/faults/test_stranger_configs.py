"""A stranger's folder of configurations says what is flown, never where results go or whom to connect to."""

from __future__ import annotations

from pathlib import Path

import pytest

from uavexp.config.composition import Composer
from uavexp.config.overrides import parse_settings
from uavexp.errors import ConfigError, UavexpError
from uavexp.parameters import GREATEST_INT

RUNNER = (
    "backend: dask\nn_jobs: 2\ntimeout_s: 900.0\nmemory_mb: 4096\ndry_run: false\naccept_other_code: false\n"
)


@pytest.mark.parametrize(
    ("file", "text", "typed"),
    [
        ("runner/fast.yaml", f"{RUNNER}address: tcp://127.0.0.1:1\nqueue: null\n", "runner=fast"),
        ("runner/fast.yaml", f"{RUNNER}address: null\nqueue: slurm\n", "runner=fast"),
        ("runner/fast.yaml", f"{RUNNER}address: ${{oc.env:HOME}}\nqueue: null\n", "runner=fast"),
        ("strategy/fast.yaml", "# @package _global_\nout: /tmp/stolen\n", "strategy=fast"),
    ],
)
def test_a_file_that_says_where_is_refused_by_name(file: str, text: str, typed: str, tmp_path: Path) -> None:
    """The client unpickles what a scheduler sends, so an address from a file ran its code."""
    (tmp_path / file).parent.mkdir(parents=True)
    (tmp_path / file).write_text(text)
    with pytest.raises(ConfigError, match=r"sets (out|runner\.(address|queue))=.* count only as typed"):
        Composer(user_folder=tmp_path).command(parse_settings([typed]))


def test_the_same_counts_as_typed() -> None:
    typed = ["runner=dask", "runner.address=tcp://127.0.0.1:1", "out=/tmp/mine"]
    command = Composer().command(parse_settings(typed))
    assert (command.runner["address"], command.out) == ("tcp://127.0.0.1:1", "/tmp/mine")


@pytest.mark.parametrize(
    "typed",
    [
        "seed=18446744073709551616",
        f"seed={GREATEST_INT + 1}",
        "seed=0:99999999999999999999",
        "world_seed=99999999999999999999",
        "mapping.miss_evidence=99999999999999999999",
        "mission.blocks=1e300",
    ],
)
def test_a_whole_number_that_no_table_holds_is_refused(typed: str) -> None:
    """Used to fly, and then to end every command on the folder."""
    with pytest.raises(UavexpError, match=f"at most {GREATEST_INT}"):
        Composer().command(parse_settings([typed, *(["mission=inspect"] if "blocks" in typed else [])]))


def test_a_number_of_thousands_of_digits_is_one_short_line() -> None:
    with pytest.raises(ConfigError) as caught:
        Composer().command(parse_settings([f"seed={'9' * 5000}"]))
    assert len(str(caught.value)) < 300


def test_the_greatest_seed_is_one() -> None:
    assert Composer().command(parse_settings([f"seed={GREATEST_INT}"])).seeds == (GREATEST_INT,)

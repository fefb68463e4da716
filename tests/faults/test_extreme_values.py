"""Names, numbers and physics that nobody means are refused in one line, if need be at the first step."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import pytest

from tests.sweeps import QUICK, begin, records, variables
from uavexp.__main__ import main
from uavexp.config.composition import Composer
from uavexp.config.overrides import parse_settings
from uavexp.errors import UavexpError
from uavexp.store.folder import folder_of
from uavexp.sweep.runner import read_runner

LONG = "a" * 300


@pytest.mark.parametrize(
    "typed",
    [
        f"strategy={LONG}", f"out={LONG}", "out='a\0b'", "out='~nobody_of_that_name/x'", "out='a\nb'",
        "step_s=1e-300", "step_s=1e-7", "step_s=10", "mapping.voxel_size_m=5", "runner.timeout_s=1e-300",
        "runner.timeout_s=1e300", "runner.n_jobs=1e9", "runner.memory_mb=1e-9", "vehicle.mass_kg=1e-300",
        "vehicle.max_acceleration_mps2=1e-300", "metrics=7", "metrics=[[]]",
    ],
)  # fmt: skip
def test_it_is_refused_before_anything_is_made(typed: str) -> None:
    with pytest.raises(UavexpError) as caught:  # noqa: PT012
        command = Composer().command(parse_settings([typed]))
        read_runner(command.runner)
        folder_of(command)
    assert 0 < len(str(caught.value)) < 2000


@pytest.mark.parametrize(
    ("typed", "words"),
    [
        ("safety=[0,0,0]", r"safety=\[0,0,0\]: no such option; safety may be"),
        ("planner.shape=[]", r"planner.shape=\[\]: no such option"),
        ("controller.drag_kgpm=1000", "at most 1.18 kg/m can be flown"),
        ("controller=flatness controller.drag_kgpm=2", "at most 1.18 kg/m can be flown"),
        ("vehicle=quadrotor vehicle.drag_coefficient=1e6", "at most 1.18 kg/m can be flown"),
        ("controller.velocity_gain_per_s=1e4", "must be at most rate_hz = 100"),
        ("mapping.forget_s=1e-20", "forget_s must be >= 0.1"),
        ("mapping.hit_evidence=32", "hit_evidence must be 1 to 31"),
        ("mapping.miss_evidence=9223372036854775807", "miss_evidence must be 1 to 31"),
        ("world=multilevel world.size_m=[2.25,6.06,8.46] world.hatch_m=0.85", "must be at least 2.4 m long"),
        ("planner=rrtstar planner.find=ompl_rrtstar planner.find.goal_bias=0", "must be 0.001 to 1"),
    ],
)
def test_what_would_fly_as_nonsense_is_told_what_is_allowed(typed: str, words: str) -> None:
    with pytest.raises(UavexpError, match=words):
        Composer().command(parse_settings(typed.split()))


def test_a_preset_that_includes_itself_is_one_line(tmp_path: Path) -> None:
    (tmp_path / "strategy").mkdir()
    (tmp_path / "strategy" / "loop.yaml").write_text("# @package _global_\ndefaults: [/strategy: loop]\n")
    with pytest.raises(UavexpError, match="holds itself"):
        Composer(user_folder=tmp_path).command(parse_settings(["strategy=loop"]))


@pytest.mark.parametrize(
    ("typed", "words"),
    [
        (["vehicle=quadrotor", "vehicle.inertia_x_kgm2=1e-300"], "numbers overflow"),
        (["mission.time_base_s=1e12"], "can be: lower mission.time_base_s"),
    ],
)
def test_physics_that_no_number_holds_is_bad_input(
    typed: list[str], words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A division by zero, a NaN that became an index, an array of 566 GB."""
    keys = {word.split("=")[0] for word in typed}
    others = [word for word in QUICK if word.split("=")[0] not in keys]
    assert main([*others, *typed, f"out={tmp_path / 'out'}"]) == 2
    error = capsys.readouterr().err
    assert words in error
    assert error.count("\n") == 1
    assert not (tmp_path / "out").exists()


@pytest.mark.skipif(signal.getsignal(signal.SIGHUP) is signal.SIG_IGN, reason="nohup: it is to go on")
def test_a_terminal_that_closes_leaves_the_tables(tmp_path: Path) -> None:
    """SIGHUP ended the process at once, without any."""
    out = tmp_path / "out"
    process = begin(*QUICK, "seed=0:40", "world_seed=0", "runner.n_jobs=1", f"out={out}")
    while not records(out):
        assert process.poll() is None
        time.sleep(0.02)
    process.send_signal(signal.SIGHUP)
    _, error = process.communicate(timeout=120)
    assert (process.returncode, error) == (130, "interrupted\n")
    assert (out / "trials.parquet").is_file()


START = "from uavexp.sweep.fork_server import start_fork_server as f; f(); import os, signal; {}"


def test_what_a_killed_command_left_in_the_temporary_folder_goes_with_the_next() -> None:
    with tempfile.TemporaryDirectory() as place:  # of a shorter name than `tmp_path`
        for last in ("os.kill(os.getpid(), signal.SIGKILL)", "pass"):
            command = [sys.executable, "-c", START.format(last)]
            subprocess.run(command, env=variables(TMPDIR=place), timeout=120)
            assert len(os.listdir(place)) == (1 if "kill" in last else 0)


def test_a_temporary_folder_of_any_length_is_none_too_long(tmp_path: Path) -> None:
    """A socket's name in it had more than its 107 bytes: no sweep could begin where TMPDIR is deep."""
    (deep := tmp_path / ("a" * 90)).mkdir()
    command = [sys.executable, "-c", START.format("pass")]
    done = subprocess.run(command, env=variables(TMPDIR=str(deep)), capture_output=True, timeout=120)
    assert (done.returncode, done.stderr) == (0, b"")
    assert not os.listdir(deep)

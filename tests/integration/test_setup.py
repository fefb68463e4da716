"""The set-up: the lock, the Makefile, and the files that describe the project agree with each other."""

from __future__ import annotations

import importlib.metadata
import os
import re
import shutil
import subprocess
import sys
import tomllib
import types
from pathlib import Path

import numpy as np
import pytest
import yaml
from packaging.requirements import Requirement

from tests.folders import ROOT
from uavexp.check.fields import field_from
from uavexp.trajectory import evaluate
from uavexp.types import Goal, Limits, PlanRequest, PlanStatus

LOCK = (ROOT / "requirements.lock").read_text()
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
DIRECT = [*PROJECT["dependencies"], *PROJECT["optional-dependencies"]["test"], "hatchling"]

needs_make = pytest.mark.skipif(shutil.which("make") is None, reason="make is not installed")


def locked() -> dict[str, Requirement]:
    """Requirements of the lock by name."""
    lines = re.findall(r"^([a-z0-9][^\n\\]*?)\s*\\\n", LOCK, flags=re.MULTILINE)
    requirements = [Requirement(line) for line in lines]
    return {requirement.name: requirement for requirement in requirements}


def make(*arguments: str, path: str | None = None) -> str:
    """What make would do, as text."""
    environment = {name: value for name, value in os.environ.items() if name not in ("PYTHON", "UV", "VENV")}
    environment |= {"PATH": path} if path is not None else {}
    command = [shutil.which("make"), "--no-print-directory", "-C", str(ROOT), "--dry-run", *arguments]
    done = subprocess.run(command, capture_output=True, text=True, env=environment, timeout=60, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout


class TestLock:
    def test_every_package_has_one_version_and_its_hashes(self):
        blocks = re.split(r"\n(?=[a-z0-9])", LOCK)[1:]
        assert len(blocks) == len(locked()) > 50
        for block in blocks:
            assert re.search(r"==\S+", block.splitlines()[0]), block.splitlines()[0]
            assert re.search(r"--hash=sha256:[0-9a-f]{64}", block), block.splitlines()[0]

    def test_names_no_host_and_no_path(self):
        for pattern in ("://", "index-url", "find-links", "file:", " @ ", "/home/", "/root/"):
            assert pattern not in LOCK, pattern

    @pytest.mark.parametrize("text", DIRECT)
    def test_holds_every_dependency_at_a_version_the_project_allows(self, text):
        wanted = Requirement(text)
        (pin,) = locked()[wanted.name].specifier
        assert wanted.specifier.contains(pin.version), f"{wanted} is locked to {pin}: run make lock"

    def test_open3d_is_locked_once_on_every_platform(self):
        marker = {name: locked()[name].marker for name in ("open3d", "open3d-cpu")}
        for platform, machine in (
            ("linux", "x86_64"),
            ("linux", "aarch64"),
            ("darwin", "arm64"),
            ("win32", "AMD64"),
        ):
            environment = {"sys_platform": platform, "platform_machine": machine}
            assert sum(each.evaluate(environment) for each in marker.values()) == 1, environment

    @pytest.mark.skipif(
        not (Path(sys.prefix) / ".installed").exists(), reason="this environment was not set up by make"
    )
    def test_is_what_is_installed(self):
        for name, requirement in locked().items():
            if requirement.marker is None or requirement.marker.evaluate():
                version = importlib.metadata.version(name)
                assert requirement.specifier.contains(version), f"{name} {version}"


@needs_make
class TestMakefile:
    def fake_python(self, folder: Path, name: str, body: str) -> None:
        script = folder / name
        script.write_text(f"#!/bin/sh\n{body}\n")
        script.chmod(0o755)

    def chosen(self, folder: Path) -> str:
        plan = make("run", f"VENV={folder}/env", "UV=", path=f"{folder}:/nowhere")
        return re.search(r"(\S+) -m venv", plan).group(1)

    def test_flies_mcr_with_seed_0_unless_told_otherwise(self):
        assert "python -m uavexp strategy=mcr seed=0\n" in make("run")
        assert "python -m uavexp strategy=tbr seed=0:3\n" in make("run", "ARGS=strategy=tbr seed=0:3")

    def test_takes_the_newest_python_that_runs_and_is_supported(self, tmp_path):
        self.fake_python(
            tmp_path, "python3.13", "echo 'pyenv: command not found' >&2; exit 127"
        )  # a dead shim
        self.fake_python(tmp_path, "python3.12", "echo /found/python3.12")
        self.fake_python(tmp_path, "python3.11", "echo /found/python3.11")
        assert self.chosen(tmp_path) == "/found/python3.12"

    def test_passes_over_a_python_that_is_too_old(self, tmp_path):
        # the check is run by the interpreter itself: let ours pretend to be 3.10
        old = f'exec {sys.executable} -c "import sys; sys.version_info = (3, 10, 1); exec(sys.argv[1])" "$2"'
        self.fake_python(tmp_path, "python3.13", old)
        self.fake_python(tmp_path, "python3", f'exec {sys.executable} "$@"')
        assert self.chosen(tmp_path) == sys.executable

    def test_the_environment_is_made_once_and_again_when_the_lock_changes(self, tmp_path):
        stamp = tmp_path / ".installed"
        stamp.touch()
        assert "install" not in make("run", f"VENV={tmp_path}").replace(".installed", "")
        os.utime(stamp, (0, 0))
        assert "--require-hashes -r requirements.lock" in make("run", f"VENV={tmp_path}")

    @pytest.mark.parametrize("uv", ["", "uv"])
    def test_installs_only_what_is_locked_and_this_project_without_its_dependencies(self, tmp_path, uv):
        plan = make("test", f"VENV={tmp_path}", f"UV={uv}", "PYTHON=python3")
        installs = [line for line in plan.splitlines() if "pip install" in line]
        assert len(installs) == 2
        assert "--require-hashes -r requirements.lock" in installs[0]
        assert "--no-deps --no-build-isolation -e ." in installs[1]
        assert all(line.startswith("uv ") == bool(uv) for line in installs)


class TestDescriptions:
    def test_one_version_everywhere(self):
        citation = yaml.safe_load((ROOT / "CITATION.cff").read_text())
        assert str(citation["version"]) == PROJECT["version"]
        assert f"## {PROJECT['version']}\n" in (ROOT / "CHANGELOG.md").read_text()

    def test_one_licence_everywhere(self):
        assert (ROOT / "LICENSE").read_text().startswith("MIT License\n")
        assert yaml.safe_load((ROOT / "CITATION.cff").read_text())["license"] == PROJECT["license"] == "MIT"


@pytest.fixture(scope="module")
def guide():
    text = (ROOT / "CONTRIBUTING.md").read_text()
    blocks = {
        language: re.search(rf"```{language}\n(.*?)```", text, re.DOTALL) for language in ("python", "yaml")
    }
    module = types.ModuleType("uavexp.planner.straight")
    sys.modules[module.__name__] = module
    try:
        exec(blocks["python"].group(1), module.__dict__)
        yield module, yaml.safe_load(blocks["yaml"].group(1))
    finally:
        del sys.modules[module.__name__]


class TestContributingGuide:
    """The planner that the guide shows really is one."""

    START_M, GOAL_M = np.array([1.0, 2.0, 1.0]), np.array([6.0, 2.0, 1.0])

    def plan(self, module, occupied):
        planner = module.Straight()
        limits = Limits(
            max_speed_mps=2.5,
            max_acceleration_mps2=2.5,
            max_body_rate_radps=2.0,
            body_size_m=(0.32, 0.32, 0.12),
        )
        planner.reset(limits, np.random.default_rng(0))
        request = PlanRequest(
            time_s=3.0,
            position_m=self.START_M,
            velocity_mps=np.array([0.5, 0.2, 0.0]),
            acceleration_mps2=np.array([0.1, -0.3, 0.2]),
            goal=Goal(position_m=self.GOAL_M, is_target=True, score=0.0),
            field=field_from(occupied),
            flight_bounds_m=np.array([[0.0, 0.0, 0.0], [8.0, 4.0, 2.0]]),
        )
        return request, limits, planner.plan(request)

    def test_it_keeps_the_contract(self, guide):
        occupied = np.zeros((80, 40, 20), dtype=bool)
        occupied[:, :2] = True
        request, limits, result = self.plan(guide[0], occupied)
        assert result.status is PlanStatus.OK
        first, *_, last = zip(
            *evaluate(result.trajectory, np.linspace(3.0, result.trajectory.end_s, 500)), strict=True
        )
        for value, wanted in zip(
            first, (request.position_m, request.velocity_mps, request.acceleration_mps2), strict=True
        ):
            np.testing.assert_allclose(value, wanted, atol=1e-9)
        for value, wanted in zip(last, (self.GOAL_M, np.zeros(3), np.zeros(3)), strict=True):
            np.testing.assert_allclose(value, wanted, atol=1e-6)
        _, velocity, acceleration = evaluate(
            result.trajectory, np.linspace(3.0, result.trajectory.end_s, 500)
        )
        assert np.linalg.norm(velocity, axis=1).max() <= limits.max_speed_mps + 1e-3
        assert np.linalg.norm(acceleration, axis=1).max() <= limits.max_acceleration_mps2 + 1e-2

    def test_it_refuses_to_fly_through_a_wall(self, guide):
        occupied = np.zeros((80, 40, 20), dtype=bool)
        occupied[40:42] = True
        assert self.plan(guide[0], occupied)[2].status is PlanStatus.NOT_CLEAR

    def test_its_yaml_names_every_parameter_with_its_default(self, guide):
        module, config = guide
        assert config.pop("_target_") == "uavexp.planner.straight.Straight"
        planner = module.Straight()
        assert config == {name: getattr(planner, name) for name in ("clearance_m", "longest_s")}

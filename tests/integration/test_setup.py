"""The set-up: the lock, the Makefile, and the files that describe the project agree with each other."""

from __future__ import annotations

import importlib.metadata
import os
import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
import yaml
from packaging.requirements import Requirement

from tests.folders import ROOT

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

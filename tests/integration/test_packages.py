"""Wheel and sdist: what is in them is all that is needed, from an empty folder, without the checkout."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
import tarfile
import tomllib
import zipfile
from pathlib import Path

import pytest
import yaml
from packaging.specifiers import SpecifierSet

from tests.folders import DATA, ROOT

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
CI = yaml.safe_load((ROOT / ".github/workflows/ci.yml").read_text())


def build(source: Path, kind: str, target: Path) -> Path:
    """A package of this kind, made offline by the back end of the environment."""
    command = [sys.executable, "-m", "hatchling", "build", "--target", kind, "--directory", str(target)]
    subprocess.run(command, cwd=source, check=True, capture_output=True)
    return next(target.iterdir())


@pytest.fixture(scope="module")
def sdist(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build(ROOT, "sdist", tmp_path_factory.mktemp("sdist"))


@pytest.fixture(scope="module")
def wheel(sdist: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The wheel that a user gets who has the sdist alone."""
    with tarfile.open(sdist) as packed:
        packed.extractall(sdist.parent / "unpacked", filter="data")
    return build(next((sdist.parent / "unpacked").iterdir()), "wheel", tmp_path_factory.mktemp("wheel"))


@pytest.fixture(scope="module")
def installed(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with what the wheel installs, dependencies apart."""
    folder = tmp_path_factory.mktemp("installed")
    with zipfile.ZipFile(wheel) as packed:
        packed.extractall(folder)
    return folder


def run(installed: Path, where: Path, *words: str) -> str:
    """Standard output of a command of the installed package, whose folder stands before the checkout's."""
    variables = {**os.environ, "PYTHONPATH": str(installed), "HOME": str(where)}
    done = subprocess.run(
        [sys.executable, *words], cwd=where, env=variables, capture_output=True, text=True, timeout=300
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_the_sdist_builds_the_same_wheel_as_the_checkout(wheel: Path, tmp_path: Path) -> None:
    own = build(ROOT, "wheel", tmp_path / "dist")
    with zipfile.ZipFile(own) as one, zipfile.ZipFile(wheel) as other:
        assert sorted(one.namelist()) == sorted(other.namelist())


def test_the_packages_are_small_and_hold_no_results(wheel: Path, sdist: Path) -> None:
    assert wheel.stat().st_size < 3e6
    assert sdist.stat().st_size < 20e6
    with zipfile.ZipFile(wheel) as packed:
        unwanted = re.compile(r"(^|/)experiments/.*/results/|^tests")
        assert not [name for name in packed.namelist() if unwanted.search(name)]


def test_the_installed_package_runs_from_an_empty_folder(installed: Path, tmp_path: Path) -> None:
    where = run(installed, tmp_path, "-c", "import uavexp; print(uavexp.__file__)")
    assert Path(where.strip()).is_relative_to(installed)
    assert run(installed, tmp_path, "-m", "uavexp", "--version") == f"uavexp {PROJECT['version']}\n"
    assert "mcr/table1" in run(installed, tmp_path, "-m", "uavexp", "--help")
    listed = run(
        installed, tmp_path, "-m", "uavexp", "experiments=mcr/table1", "seed=0", "runner.dry_run=true"
    )
    assert "to fly 50 trials" in listed
    (entries,) = installed.glob("*.dist-info/entry_points.txt")
    assert f"uavexp = {PROJECT['scripts']['uavexp']}" in entries.read_text()


def test_the_installed_package_makes_reports_with_its_own_assets(installed: Path, tmp_path: Path) -> None:
    shutil.copytree(DATA / "study", tmp_path / "study")
    run(installed, tmp_path, "-m", "uavexp.show", "study", "--out", "show.html")
    assert (tmp_path / "show.html").stat().st_size > 10_000
    shutil.rmtree(
        tmp_path / "study" / "trials"
    )  # figures of single flights need kernels, compiled for a minute
    run(installed, tmp_path, "-m", "uavexp.report", "study")
    page = (tmp_path / "study" / "report.html").read_text()
    assert "sortBy" in page
    assert "10.3390/drones10030168" in page  # of experiments/mcr/paper.txt


class TestPlacesToRun:
    def test_every_supported_python_is_tested_and_named(self) -> None:
        supported = SpecifierSet(PROJECT["requires-python"])
        tested = CI["jobs"]["test"]["strategy"]["matrix"]["python"]
        every = [f"3.{minor}" for minor in range(30) if f"3.{minor}" in supported]
        assert tested == every
        named = [line.rpartition(" ")[2] for line in PROJECT["classifiers"] if "Python :: 3." in line]
        assert named == every

    def test_image_and_ci_install_the_libraries_that_open3d_asks_for(self) -> None:
        source = (ROOT / "uavexp/o3d.py").read_text()
        wanted = re.findall(r"\blib[\w.-]+", source[source.index("apt-get install") :].split('"\n')[1])
        assert len(wanted) == 6
        image = (ROOT / "Dockerfile").read_text()
        for job in CI["jobs"].values():
            assert all(name in str(job["steps"]) for name in wanted)
        assert all(name in image for name in wanted)
        version = re.search(r"^FROM python:([\d.]+)", image, re.M)
        assert version is not None
        assert version[1] in SpecifierSet(PROJECT["requires-python"])

    def test_the_container_of_editors_is_that_image(self) -> None:
        made = json.loads((ROOT / ".devcontainer/devcontainer.json").read_text())
        assert (ROOT / ".devcontainer" / made["build"]["dockerfile"]).resolve() == ROOT / "Dockerfile"
        assert f"WORKDIR {made['workspaceFolder']}\n" in (ROOT / "Dockerfile").read_text()

    def test_extras_that_pages_name_exist(self) -> None:
        extras = set(PROJECT["optional-dependencies"])
        for page in [ROOT / "README.md", *(ROOT / "docs").rglob("*.md")]:
            for names in re.findall(r"uavexp\[([\w,]+)\]", page.read_text()):
                assert set(names.split(",")) <= extras, page

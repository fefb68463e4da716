"""CONTRIBUTING's examples, dropped into a folder of their own, run as printed."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pandas as pd
import pytest

from tests.folders import ROOT
from tests.sweeps import variables

GUIDE = (ROOT / "CONTRIBUTING.md").read_text()
FILES = {  # the last file named before a block of code is that block
    re.findall(r"`((?:mine|conf)/[\w/]+\.\w+)`", GUIDE[: block.start()])[-1]: block[1]
    for block in re.finditer(r"```(?:python|yaml)\n(.*?)```", GUIDE, re.S)
}
COMMANDS = [line for block in re.findall(r"```sh\n(.*?)```", GUIDE, re.S) for line in block.splitlines()]
# the same flights, smaller: what a command flies is added to it
SMALLER = {
    "planner=straight": " mission.time_base_s=2 mission.time_per_path_spm=0",
    "experiments=": " vehicle=point_mass mission.time_base_s=4 mission.time_per_path_spm=0 out=study",
}


def smaller(command: str) -> str:
    if not command.startswith("python -m uavexp "):
        return command
    return command + next(more for part, more in SMALLER.items() if part in command)


@pytest.fixture(scope="module")
def project(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder after all of the guide's commands, each of which has ended well."""
    folder = tmp_path_factory.mktemp("project")
    for name, text in FILES.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text)
    (folder / "mine/__init__.py").touch()
    script = "set -ex\n" + "\n".join(map(smaller, COMMANDS))
    path = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
    done = subprocess.run(
        ["bash", "-c", script],
        cwd=folder,
        env=variables(PATH=path),
        capture_output=True,
        text=True,
        timeout=500,
        check=False,
    )
    assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-3000:]
    (folder / "said").write_text(done.stdout)
    return folder


def test_it_names_a_planner_a_trigger_a_metric_and_an_experiment() -> None:
    assert set(FILES) == {
        "mine/straight.py",
        "mine/odometer.py",
        "mine/climb.py",
        "conf/experiments/mine/first.yaml",
    }


def test_its_planner_and_trigger_keep_every_promise(project: Path) -> None:
    said = (project / "said").read_text()
    assert said.count("every promise is kept") == 2
    assert 'planner=straight: "keeps the speed limit" is kept' in said


def test_its_experiment_has_the_metric_and_a_report(project: Path) -> None:
    trials = pd.read_parquet(project / "study/trials.parquet")
    assert len(trials) == 6
    assert (trials["climb_m"] >= 0.0).all()
    assert "Height gained" in (project / "study/report.html").read_text()
    assert "no trials of" not in (project / "study/claims.csv").read_text()

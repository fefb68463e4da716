"""The site builds without a warning, asks nobody for anything, and the README's links lead somewhere."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from uavexp.config.options import list_options
from uavexp.paths import PACKAGE, conf_folder

ROOT = PACKAGE.parent
README = (ROOT / "README.md").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("site")
    built = subprocess.run(
        [sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", str(folder)],
        cwd=ROOT, capture_output=True, text=True, env={**os.environ, "NO_MKDOCS_2_WARNING": "1"},
    )  # fmt: skip
    assert built.returncode == 0, built.stderr[-2000:]
    return folder


def test_every_group_and_every_committed_study_has_its_page(site: Path) -> None:
    for group in list_options([conf_folder()]):
        assert (site / "reference" / group / "index.html").is_file(), group
    for study in ROOT.glob("experiments/*/results/*/study.json"):
        assert (site / study.parent.relative_to(ROOT) / "index.html").is_file(), study


def test_no_page_asks_another_host_for_anything(site: Path) -> None:
    asks = re.compile(r"<(?:script|img|iframe|source)[^>]*\bsrc=\"?https?:|<link[^>]*stylesheet[^>]*https?:")
    for page in site.rglob("*.html"):
        assert not asks.search(page.read_text(encoding="utf-8")), page


def test_the_readme_is_short_and_its_links_lead_somewhere() -> None:
    assert len(README.encode()) <= 8000
    for target in re.findall(r"\]\((?!https?:)([^)#]+)\)", README):
        assert (ROOT / target).exists(), target

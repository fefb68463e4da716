"""Pages of the site as a person sees them: nothing in red, nothing fetched, nothing cut off."""

from __future__ import annotations

import os
import subprocess
import sys
import threading
from collections.abc import Iterator
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import pytest

from tests.browser.browser import CHROMIUM, Browser
from tests.browser.conftest import SHOTS
from tests.folders import ROOT

KINDS = ("", "commands/", "papers/mcr/", "reference/trigger/", "experiments/mcr/results/table1/", "api/")


class _Silent(SimpleHTTPRequestHandler):
    def log_message(self, *words: object) -> None:
        """Say nothing."""


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Path, str]]:
    """The folder of the site, and its address on this machine."""
    if CHROMIUM is None:
        pytest.skip("no chromium")
    folder = tmp_path_factory.mktemp("site")
    build = [sys.executable, "-m", "mkdocs", "build", "--quiet", "--site-dir", str(folder)]
    subprocess.run(build, cwd=ROOT, check=True, env={**os.environ, "NO_MKDOCS_2_WARNING": "1"})
    server = ThreadingHTTPServer(("127.0.0.1", 0), partial(_Silent, directory=str(folder)))
    threading.Thread(target=server.serve_forever, daemon=True).start()
    yield folder, f"http://127.0.0.1:{server.server_port}/"
    server.shutdown()


def test_pages_show_nothing_in_red_fetch_nothing_and_fit(
    browser: Browser, shots: Path, site: tuple[Path, str]
) -> None:
    """One page of each kind; every one, and its pictures kept, where UAVEXP_SHOTS names a folder."""
    folder, address = site
    every = sorted(page.parent.relative_to(folder).as_posix() + "/" for page in folder.rglob("index.html"))
    for page in [name.removeprefix("./") for name in every] if SHOTS else KINDS:
        for width_px in (1400, 390):
            seen = browser.look(address + page, width_px=width_px, settle_s=0.05)
            (shots / f"site-{page.replace('/', '-')}{width_px}.png").write_bytes(seen.png)
            assert seen.errors == [], page
            assert seen.outside == [], page
            assert seen.overflow_px <= 0, (page, width_px)

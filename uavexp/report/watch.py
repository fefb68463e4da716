"""`python -m uavexp.report DIR --watch`: a page on this machine of a study that is being flown.

Progress, failures and the tables so far. The folder is only read: the tables are made of its records in
a folder of their own.
"""

from __future__ import annotations

import re
import tempfile
import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime
from functools import partial
from html import escape
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

from uavexp.errors import RecordError, UavexpError, one_line
from uavexp.report.contents import Report
from uavexp.report.html import asset, page
from uavexp.report.html_failed import failed_trials
from uavexp.report.html_parts import paragraph, table
from uavexp.store.history import FLYING
from uavexp.store.records import PICTURE, RECORD
from uavexp.store.study import (
    RUN,
    STUDY,
    TRIALS,
    WORLDS,
    Study,
    collect,
    read_runs,
    read_study,
    trial_folders,
)

_LINKED = (STUDY, RUN, TRIALS, WORLDS)
_PICTURE = re.compile(rf"/({TRIALS}/[\w.-]+/{PICTURE})")
_REST = 4.0  # so many times as long as a page takes, the next one waits: flights have the machine
_HOST, _ANY_PORT = "127.0.0.1", 0


def watch(folder: Path, say: Callable[[str], None], port: int = _ANY_PORT) -> None:
    """Serve the page of a study until interrupted.

    Args:
        folder: of the study.
        say: told the page's address.
        port: of the page; 0: any that is free.

    Raises:
        RecordError: no study, or the port is taken.
    """
    read_study(folder)
    with tempfile.TemporaryDirectory(prefix="uavexp-watch-") as shadow:
        view = View(folder=folder.resolve(), shadow=Path(shadow))
        try:
            server = ThreadingHTTPServer((_HOST, port), partial(_Handler, view))
        except OSError as error:
            raise RecordError(f"port {port}: {error.strerror}; name another with --port=N") from error
        with server:
            say(f"{folder} is shown at http://{_HOST}:{server.server_port}/ until Ctrl-C")
            server.serve_forever()


@dataclass(kw_only=True)
class View:
    """The page of a study, made anew when it has flown on."""

    folder: Path
    shadow: Path  # links to the study, and tables of what it has so far
    _made: str = ""
    _of: object = None  # what the page was made of
    _next_s: float = 0.0  # not before this time, monotonic
    _lock: threading.Lock = field(default_factory=threading.Lock)

    def page(self) -> str:
        """The page as it is now, or was a moment ago."""
        with self._lock:
            now = self._state()
            if now != self._of and time.monotonic() >= self._next_s:
                begin_s = time.monotonic()
                self._made, self._of = self._make(), now
                self._next_s = time.monotonic() + _REST * (time.monotonic() - begin_s)
            return self._made

    def picture(self, address: str) -> bytes | None:
        """Picture of a trial by its address on the page; None where there is none."""
        asked = _PICTURE.fullmatch(address)
        file = self.folder / asked[1] if asked else None
        return file.read_bytes() if file is not None and file.is_file() else None

    def _state(self) -> object:
        runs = self.folder / RUN
        return len(list(trial_folders(self.folder))), runs.stat().st_mtime_ns if runs.is_file() else 0

    def _make(self) -> str:
        for name in _LINKED:
            link = self.shadow / name
            if not link.is_symlink() and (self.folder / name).exists():
                link.symlink_to(self.folder / name)
        try:
            return live_page(self.shadow)
        except UavexpError as error:  # a record that is being set aside while it is read
            return _page(str(self.folder), paragraph(one_line(error)), {})


def live_page(folder: Path) -> str:
    """The page of what a study folder holds; its tables of trials are made anew."""
    study = read_study(folder)
    flown = len(collect(folder)) if (folder / TRIALS).is_dir() else 0
    title, beginning = study.title or study.name or "Trials", _progress(study, flown)
    if not flown:
        return _page(title, beginning, {})
    report = Report(study=study)
    sections = {
        "Tables so far": "\n".join(table(made) for made in report.tables),
        "Failures so far": failed_trials(report.results),
    }
    return _page(title, beginning, sections)


def _page(title: str, beginning: str, sections: Mapping[str, str]) -> str:
    script = f"<script>\n{asset('watch.js')}</script>\n</body>"
    return page(title, beginning, sections).replace("</body>", script)


def _progress(study: Study, flown: int) -> str:
    """How many of the trials asked for have flown, and when the rest will have."""
    asked = max(flown, len(study.cells) * len(study.seeds))
    runs = read_runs(study.folder)
    failed = ""
    if flown:
        lost = int((~study.measurements["success"].astype(bool)).sum())
        failed = f", {lost} of them without success"
    command = " ".join(runs[-1].get("command", ())) if runs else ""
    return (
        f'<p><progress max="{asked}" value="{flown}"></progress> {flown} of {asked} trials{failed}. '
        f"{escape(_when(study.folder, runs[-1], asked - flown) if runs else '')}</p>"
        f"<p><code>python -m uavexp {escape(command)}</code></p>"
    )


def _when(folder: Path, run: Mapping[str, Any], left: int) -> str:
    """How the last command stands: how it ended, or how long it will take by its pace so far."""
    if run.get("ended") != FLYING:
        return f"The command has ended: {run.get('ended', 'not said how')}."
    began = datetime.fromisoformat(str(run["began"]))
    files = (item / RECORD for item in trial_folders(folder))
    done = sum(file.stat().st_mtime >= began.timestamp() for file in files if file.is_file())
    passed_s = (datetime.now(UTC) - began).total_seconds()
    if not done:
        return "The first trials are being flown."
    return f"{60.0 * done / passed_s:.1f} a minute; about {left * passed_s / done / 60.0:.0f} min are left."


class _Handler(BaseHTTPRequestHandler):
    """Answers this machine's browser with the page and pictures of trials, with nothing else."""

    def __init__(self, view: View, *arguments: Any) -> None:
        self._view = view
        super().__init__(*arguments)

    def do_GET(self) -> None:
        """Answer one request."""
        if self.path == "/":
            self._answer(self._view.page().encode(), "text/html; charset=utf-8")
        elif (picture := self._view.picture(self.path)) is not None:
            self._answer(picture, "image/png")
        else:
            self.send_error(404)

    def _answer(self, body: bytes, kind: str) -> None:
        self.send_response(200)
        self.send_header("Content-Type", kind)
        self.send_header("Content-Length", str(len(body)))
        self.send_header("Cache-Control", "no-store")
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, format: str, *words: Any) -> None:
        """Say nothing: the terminal belongs to the person."""

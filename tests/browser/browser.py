"""A page as a person sees it: headless Chromium, told by its DevTools protocol what to open."""

from __future__ import annotations

import asyncio
import base64
import json
import shutil
import subprocess
import time
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from tornado.websocket import WebSocketClientConnection, websocket_connect

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
_FLAGS = (
    "--headless=new", "--no-sandbox", "--remote-debugging-port=0", "--hide-scrollbars", "--no-first-run",
    "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--disable-dev-shm-usage",
    "--disable-background-networking", "--disable-component-update",
)  # fmt: skip
_OWN = ("file:", "data:", "blob:", "about:", "http://127.0.0.1", "http://localhost")
_PATIENCE_S = 60.0


@dataclass(frozen=True, kw_only=True)
class Seen:
    """What came of opening a page."""

    errors: list[str]  # of the console
    outside: list[str]  # requests to another host
    overflow_px: int  # by which the page is wider than the window
    answers: list[Any]  # of the scripts asked
    png: bytes


@dataclass(kw_only=True)
class Browser:
    """A running browser; each page in a tab of its own."""

    port: int

    def look(
        self, url: str, *, width_px: int, height_px: int = 900, dark: bool = False, whole: bool = False,
        ask: tuple[str, ...] = (), settle_s: float = 0.3,
    ) -> Seen:  # fmt: skip
        """Open a page, ask it scripts, and take its picture; `whole`: all of it, not one window."""
        opened = urllib.request.Request(f"http://127.0.0.1:{self.port}/json/new?about:blank", method="PUT")
        with urllib.request.urlopen(opened, timeout=_PATIENCE_S) as answer:
            tab = json.load(answer)
        size = {"width": width_px, "height": height_px, "deviceScaleFactor": 1, "mobile": width_px < 600}
        try:
            return asyncio.run(_look(tab["webSocketDebuggerUrl"], url, size, dark, whole, ask, settle_s))
        finally:
            urllib.request.urlopen(
                f"http://127.0.0.1:{self.port}/json/close/{tab['id']}", timeout=_PATIENCE_S
            )


@contextmanager
def chromium(folder: Path) -> Iterator[Browser]:
    """A browser whose profile lies in this folder."""
    command = [str(CHROMIUM), *_FLAGS, f"--user-data-dir={folder}", "about:blank"]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        port, end_s = folder / "DevToolsActivePort", time.monotonic() + _PATIENCE_S
        while not (port.is_file() and port.read_text().count("\n")):
            if process.poll() is not None or time.monotonic() > end_s:
                raise RuntimeError("chromium does not start")
            time.sleep(0.05)
        yield Browser(port=int(port.read_text().splitlines()[0]))
    finally:
        process.terminate()
        process.wait(timeout=_PATIENCE_S)


@dataclass(kw_only=True)
class _Tab:
    """One conversation with a tab; events that come between answers are kept."""

    socket: WebSocketClientConnection
    events: list[dict[str, Any]] = field(default_factory=list)
    _number: int = 0

    async def call(self, method: str, **parameters: Any) -> dict[str, Any]:
        self._number += 1
        await self.socket.write_message(
            json.dumps({"id": self._number, "method": method, "params": parameters})
        )
        while (message := await self._next()).get("id") != self._number:
            self.events.append(message)
        assert "error" not in message, message
        return dict(message["result"])

    async def until(self, event: str) -> None:
        while not any(message.get("method") == event for message in self.events):
            self.events.append(await self._next())

    async def _next(self) -> dict[str, Any]:
        message = await asyncio.wait_for(self.socket.read_message(), _PATIENCE_S)
        assert message is not None, "the tab was closed"
        return dict(json.loads(message))


async def _look(
    address: str,
    url: str,
    size: dict[str, Any],
    dark: bool,
    whole: bool,
    ask: tuple[str, ...],
    settle_s: float,
) -> Seen:
    tab = _Tab(socket=await websocket_connect(address, max_message_size=2**28))
    for domain in ("Page", "Runtime", "Log", "Network"):
        await tab.call(f"{domain}.enable")
    scheme = {"name": "prefers-color-scheme", "value": "dark" if dark else "light"}
    await tab.call("Emulation.setEmulatedMedia", features=[scheme])
    await tab.call("Emulation.setDeviceMetricsOverride", **size)
    await tab.call("Page.navigate", url=url)
    await tab.until("Page.loadEventFired")
    await asyncio.sleep(settle_s)

    async def evaluate(script: str) -> Any:
        answer = await tab.call("Runtime.evaluate", expression=script, returnByValue=True, awaitPromise=True)
        assert "exceptionDetails" not in answer, answer
        return answer["result"].get("value")

    answers = [await evaluate(script) for script in ask]
    overflow_px = int(await evaluate("document.documentElement.scrollWidth - innerWidth"))
    if whole:
        height_px = int(await evaluate("document.documentElement.scrollHeight"))
        await tab.call("Emulation.setDeviceMetricsOverride", **{**size, "height": min(height_px, 16000)})
        await asyncio.sleep(settle_s)
    shot = await tab.call("Page.captureScreenshot", format="png")
    tab.socket.close()
    return Seen(
        errors=[told for event in tab.events for told in _errors(event)],
        outside=[
            address for event in tab.events for address in _asked(event) if not address.startswith(_OWN)
        ],
        overflow_px=overflow_px,
        answers=answers,
        png=base64.b64decode(shot["data"]),
    )


def _errors(event: dict[str, Any]) -> Iterator[str]:
    """What the console shows in red."""
    found = event.get("params", {})
    if event.get("method") == "Runtime.exceptionThrown":
        yield str(found["exceptionDetails"].get("exception", {}).get("description", found))
    elif event.get("method") == "Log.entryAdded" and found["entry"]["level"] == "error":
        yield f"{found['entry']['text']} {found['entry'].get('url', '')}"
    elif event.get("method") == "Runtime.consoleAPICalled" and found["type"] in ("error", "assert"):
        yield " ".join(str(part.get("value", part)) for part in found["args"])


def _asked(event: dict[str, Any]) -> Iterator[str]:
    if event.get("method") == "Network.requestWillBeSent":
        yield event["params"]["request"]["url"]

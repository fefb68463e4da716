"""One page that shows flights: everything is in it, nothing is fetched."""

from __future__ import annotations

import json
from collections.abc import Sequence
from html import escape
from pathlib import Path

from uavexp.show.flight_data import Json, page_data
from uavexp.store.stored_trial import StoredTrial

_ASSETS = Path(__file__).with_name("assets")
_SCRIPTS = ("marks.js", "camera.js", "solids.js", "show.js")
_PAGE = """<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<link rel="icon" href="data:,">
<title>{title}</title>
<style>
{style}</style>
</head>
<body>
<header>
<h1>{title}</h1>
<p>{caption}</p>
<p id="no-webgl" hidden>This browser has no WebGL 2: the map and moving obstacles are not drawn.</p>
</header>
<div class="controls">
<button id="play" type="button">Play</button>
<input id="time" type="range" min="0" step="0.01" aria-label="time in the flight">
<output id="time-s"></output>
<label>speed <select id="speed"><option>0.5</option><option selected>1</option><option>2</option>
<option>5</option><option>10</option></select></label>
<label>map up to <input id="cut" type="range" step="0.1"> <output id="cut-m"></output></label>
</div>
<main id="views"></main>
<div id="legend"></div>
<script type="application/json" id="flights">{data}</script>
<script>
{script}</script>
</body>
</html>
"""
_HOW = "Drag to turn, shift-drag to move, scroll to zoom, space to play."
_NO_GROWTH = " These flights kept no record of when the map grew: it is shown as it was at the end."


def page_html(title: str, trials: Sequence[StoredTrial]) -> str:
    """The page of flights in one world, side by side.

    Args:
        title: of the page.
        trials: at least one.
    """
    data = page_data(trials)
    scripts = [(_ASSETS / name).read_text(encoding="utf-8") for name in _SCRIPTS]
    return _PAGE.format(
        title=escape(title),
        caption=escape(_caption(data)),
        style=(_ASSETS / "show.css").read_text(encoding="utf-8"),
        data=inline_json(data),
        script="".join(script.removeprefix('"use strict";\n') for script in scripts),
    )


def inline_json(data: Json) -> str:
    """JSON for a script element; nothing in it may end the element or begin a comment."""
    text = json.dumps(data, sort_keys=True, separators=(",", ":"), allow_nan=False)
    return text.replace("<", "\\u003c")


def _caption(data: Json) -> str:
    growing = all(flight["map"]["grows"] for flight in data["flights"])
    what = "What the vehicle mapped, planned and flew" + (", as it happened" if growing else "")
    return f"{what}. {_HOW}" + ("" if growing else _NO_GROWTH)

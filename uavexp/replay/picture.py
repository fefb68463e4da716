"""The picture of a recording under several policies: who would have replanned when, and what came near."""

from __future__ import annotations

import io
from collections.abc import Sequence

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from uavexp.replay.asked import Asked
from uavexp.report import replan_marks, style

_DPI = 120
_WIDTH_IN, _HEAD_IN, _ROW_IN, _CURVE_IN = 9.0, 1.0, 0.3, 1.6


def png_of(found: Sequence[Asked], title: str) -> bytes:
    """A row per policy with a mark per replan; below the clearance ahead on the path."""
    rows_in = _ROW_IN * (len(found) + 1)
    with style.house_style():
        figure = Figure(figsize=(_WIDTH_IN, _HEAD_IN + rows_in + _CURVE_IN), layout="constrained")
        FigureCanvasAgg(figure)
        rows, curve = figure.subplots(2, 1, sharex=True, height_ratios=[rows_in, _CURVE_IN])
        for place, policy in enumerate(found):
            for request in policy.replans:
                rows.plot(request.time_s, place, **replan_marks.marker(request.cause, 7.0))
        rows.set_yticks(range(len(found)), [f"{policy.name} ({len(policy.replans)})" for policy in found])
        rows.set_ylim(len(found) - 0.5, -0.5)
        rows.grid(visible=True, axis="x")
        first = found[0]
        curve.plot(first.tick_s, first.clearance_m, color=style.BLUE, lw=1.1)
        curve.axhline(0.0, color=style.BLACK, lw=0.6)
        curve.set(xlabel="time [s]", ylabel="least clearance ahead [m]")
        curve.grid(visible=True)
        causes = list(dict.fromkeys(request.cause for policy in found for request in policy.replans))
        figure.suptitle(
            f"{title}\nwhen each policy would have replanned; cause {replan_marks.causes_key(causes)}",
            fontsize=9,
        )
        if len(first.tick_s):
            curve.set_xlim(0.0, float(np.max(first.tick_s)))
        picture = io.BytesIO()
        figure.savefig(picture, dpi=_DPI, format="png", metadata={"Software": None})
    return picture.getvalue()

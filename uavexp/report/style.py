"""The look of every figure: colours that the colour-blind and a grey printer can tell apart."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import matplotlib

# Okabe and Ito 2008, "Color universal design"
BLACK = "#000000"
ORANGE = "#E69F00"
SKY = "#56B4E9"
GREEN = "#009E73"
YELLOW = "#F0E442"
BLUE = "#0072B2"
VERMILLION = "#D55E00"
PURPLE = "#CC79A7"
WINE = "#882255"  # Tol 2021; movers as predicted, beside purple ones as they were

SURFACE = "#B4B4B4"  # true obstacles' surfaces
SOLID = "#E8E8E8"  # inside them, or shut off from the flight
MAPPED = "#2A2A2A"  # occupied voxels of the vehicle's map
FAINT = "#C8C8C8"  # grid lines, frames


def contact_marker(with_mover: bool, size_pt: float) -> dict[str, Any]:
    """Line2D settings of a contact: a cross with what stands, a burst with what moves."""
    fill = {"color": VERMILLION, "mec": BLACK, "mew": 0.7}
    return {
        "marker": (8, 1, 0) if with_mover else "X",
        "ls": "",
        "ms": size_pt * (1.4 if with_mover else 1.0),
        **fill,
    }


_SETTINGS: dict[str, object] = {
    "font.family": ["DejaVu Sans"],  # comes with matplotlib: the same on every machine
    "font.size": 9.0,
    "axes.titlesize": 9.0,
    "axes.labelsize": 9.0,
    "axes.edgecolor": "#606060",
    "axes.linewidth": 0.6,
    "axes.axisbelow": True,
    "xtick.labelsize": 8.0,
    "ytick.labelsize": 8.0,
    "xtick.color": "#404040",
    "ytick.color": "#404040",
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "grid.color": FAINT,
    "grid.linewidth": 0.4,
    "legend.fontsize": 8.0,
    "legend.frameon": False,
    "legend.handletextpad": 0.4,
    "legend.columnspacing": 1.4,
    "lines.solid_capstyle": "round",
    "pdf.fonttype": 42,  # text of a figure stays text in a paper
}


@contextmanager
def house_style() -> Iterator[None]:
    """Draw in the house style, whatever a user's own matplotlib settings are."""
    with matplotlib.rc_context():
        matplotlib.rcdefaults()
        matplotlib.rcParams.update(_SETTINGS)
        yield

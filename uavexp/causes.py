"""Why plans are asked for: every shipped cause with its words and its mark in figures.

A trigger names a cause of its own as it likes; it is counted in `replans_<cause>` and drawn
with one of the spare marks.
"""

from __future__ import annotations

import zlib
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Cause:
    """One cause of replanning; figures never tell it by colour alone."""

    name: str  # in logs, records and tables
    label: str
    colour: str  # mostly Okabe and Ito 2008, as in `report.style`
    marker: str  # of matplotlib, a filled one


MAP = Cause("map", "the map changed near the path", "#E69F00", "^")
GOAL = Cause("goal", "another goal is better", "#009E73", "D")
CLOCK = Cause("clock", "the interval passed", "#CC79A7", "s")
DISTANCE = Cause("distance", "so far was flown", "#56B4E9", "o")
COLLISION = Cause("collision", "the path is blocked", "#D55E00", "X")
COVERED = Cause("covered", "the frontier is seen", "#0072B2", "p")
EXPIRED = Cause("expired", "the plan is old", "#F0E442", "h")
ARRIVAL = Cause("arrival", "a frontier is near", "#8C6D31", "<")
COST = Cause("cost", "the path has become dearer", "#999933", "8")
RISK = Cause("risk", "a mover will come near", "#882255", ">")
POLICY = (MAP, GOAL, CLOCK, DISTANCE, COLLISION, COVERED, EXPIRED, ARRIVAL, COST, RISK)

FIRST = Cause("first", "no plan was flown yet", "#606060", "*")
RETRY = Cause("retry", "the last request brought no plan", "#606060", "P")
BRAKE = Cause("brake", "after an emergency stop", "#000000", "v")
BEHIND = Cause("behind", "the vehicle fell behind", "#D55E00", "v")
HELD = Cause("held", "the safety held the vehicle", "#0072B2", "s")
LOOK_AROUND = Cause("look_around", "the vehicle, lost, looked around", "#009E73", "P")
BACK_UP = Cause("back_up", "the vehicle, lost, backed up", "#CC79A7", "v")
LESSER_CLEARANCE = Cause("lesser_clearance", "the vehicle, lost, tried a lesser clearance", "#882255", "s")
NOTED = Cause("noted", "an obstacle was noted unseen", "#000000", "X")
RECOVERY = (LOOK_AROUND, BACK_UP, LESSER_CLEARANCE, NOTED)
PILOT = (FIRST, RETRY, BRAKE, BEHIND, HELD, *RECOVERY)
OTHER = Cause("other", "the pilot's own, counted together", "#606060", "P")

_SPARE = (("#606060", "d"), ("#882255", "H"), ("#0072B2", "8"), ("#D55E00", "d"), ("#009E73", "H"))
_BY_NAME = {cause.name: cause for cause in (*POLICY, *PILOT, OTHER)}


def cause_named(name: str) -> Cause:
    """The cause of this name; one that is not shipped has its name for a label and a spare mark."""
    colour, marker = _SPARE[zlib.crc32(name.encode()) % len(_SPARE)]
    return _BY_NAME.get(name) or Cause(name, name, colour, marker)

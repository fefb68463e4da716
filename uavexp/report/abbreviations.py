"""What the short names in reports stand for."""

from __future__ import annotations

import re

ABBREVIATIONS = {
    "SSP": "single-shot planning: one plan at the start, never another",
    "TBR": "time-based replanning: a new plan after every interval",
    "MCR": "map-change-driven replanning: a new plan when the map near the path or the goal has changed",
    "SR": "success rate: the target is reached and nothing is touched",
    "APL": "average path length",
    "CT": "completion time",
    "CC": "collision count: contacts with the true geometry",
    "MC": "minimum clearance: least distance of the body's centre from a true surface",
    "RF": "replanning frequency: replans in a mission, the first plan not counted",
    "TE": "tracking error: distance of the flown from the reference position",
    "RMSE": "root of the mean squared error",
    "ESDF": "Euclidean signed distance field",
    "MPC": "model predictive control",
    "QP": "quadratic programme",
    "BIT*": "batch-informed trees",
    "DF-BIT*": "batch-informed trees whose edges keep the vehicle's dynamic limits",
    "RRT*": "rapidly exploring random trees, optimal variant",
    "A*": "best-first search on a grid",
    "BARN": "Benchmark for Autonomous Robot Navigation",
    "δ_map": "the change of the map from which a replan is asked for",
    "δ_g": "the move of the goal from which a replan is asked for",
    "r_mon": "the distance from the path within which changes count",
}


def spelled_out(text: str) -> dict[str, str]:
    """The abbreviations that a text uses, in its own order of the list above."""
    words = set(re.findall(r"[\w*-]+", text))
    return {short: long for short, long in ABBREVIATIONS.items() if short in words}

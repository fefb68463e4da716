"""Replay a stored flight: what was known and decided at every update of the map, and its page."""

from pathlib import Path

import numpy as np

import uavexp
from uavexp.__main__ import main
from uavexp.show.page import page_html

OUT = "replay_log"

if __name__ == "__main__":
    main(["strategy=mcr", "world=random_columns", "world.size_m=[9,6,3]", "vehicle=point_mass", "seed=100",
          f"out={OUT}"])  # fmt: skip
    stored = uavexp.read_study(OUT).trial(0)
    log, ticks = stored.log, stored.log.ticks
    print("  time  mapped clearance  changed voxels  score  plan asked for")
    for time_s, clearance_m, changed, score in zip(
        ticks.tick_s, ticks.esdf_clearance_m, ticks.changed_voxels, ticks.decision_score, strict=True
    ):
        asked = [replan.cause for replan in log.replans if np.isclose(replan.time_s, time_s)]
        print(f"{time_s:6.2f}  {clearance_m:14.2f} m  {changed:14d}  {score:5.2f}  {', '.join(asked)}")
    Path("replay_log.html").write_text(page_html(stored.label, [stored]), encoding="utf-8")
    print("replay_log.html")

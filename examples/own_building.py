"""Fly in a building of one's own: a floor plan drawn in letters, half a metre each, as a ROS map."""

from pathlib import Path

import numpy as np

import uavexp

PLAN = """
########################
#........#.............#
#........#.............#
#......................#
#......................#
#........#.............#
#........#######..######
#........#.............#
####..####.............#
#......................#
#......................#
#........#.............#
#........#.............#
########################
""".split()
CELL_M = 0.5

cells = np.array([[0 if letter == "#" else 254 for letter in row] for row in PLAN])
Path("plan.pgm").write_text(
    f"P2 {cells.shape[1]} {cells.shape[0]} 255\n" + "\n".join(map(str, cells.ravel()))
)
Path("plan.yaml").write_text(
    f"image: plan.pgm\nresolution: {CELL_M}\norigin: [0, 0, 0]\nnegate: 0\n"
    "occupied_thresh: 0.65\nfree_thresh: 0.25\n"
)
building = {"world.path": "plan.yaml", "world.start_m": [1.5, 1.5, 1.2], "world.target_m": [10.5, 5.5, 1.2]}
trial = uavexp.fly(strategy="safe", world="file", seed=100, **building)
print(trial.world)
print(trial)

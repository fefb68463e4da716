"""A rule of one's own for when to replan: after so many metres, and at once where the way is narrow."""

from collections import Counter

import numpy as np

import uavexp
from uavexp.trajectory import evaluate
from uavexp.types import Decision


class Odometer:
    """Replans `after_m` behind the plan's begin, or where its next second comes nearer than `least_m`."""

    def __init__(self, after_m=2.0, least_m=0.35):
        self.after_m, self.least_m = after_m, least_m

    def reset(self, limits):
        """Begin a trial."""
        self.begin_m = None

    def planned(self, trajectory, field):
        """Note where the new plan begins."""
        self.begin_m = trajectory.coefficients[0, 0].copy()

    def decide(self, observation):
        """Asked after every update of the map; what it sees is `uavexp.types.Observation`."""
        if observation.trajectory is None or self.begin_m is None:
            return Decision(replan=False)
        ahead_m = evaluate(observation.trajectory, observation.time_s + np.linspace(0.0, 1.0, 11))[0]
        narrow = observation.field.distance_m(ahead_m).min() < self.least_m
        far = np.linalg.norm(observation.state.position_m - self.begin_m) > self.after_m
        return Decision(replan=bool(narrow or far), cause="narrow" if narrow else "metres" if far else "")


trial = uavexp.fly(
    trigger=Odometer(), world="random_columns", vehicle="point_mass", seed=100, **{"world.size_m": [12, 8, 3]}
)
print(trial, Counter(replan.cause for replan in trial.log.replans))

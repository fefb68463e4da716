"""A number of one's own: a column beside the shipped ones of every flight, and a figure of it."""

import os

import matplotlib
import numpy as np

import uavexp
from uavexp.metrics.metric import Flight, Metric

matplotlib.use("Agg")


def turned_rad(flight: Flight) -> float:
    """How much the course of a flight turned in all, rad."""
    velocity_mps = flight.log.steps.velocity_mps
    moving = np.linalg.norm(velocity_mps[:, :2], axis=1) > 0.2
    course_rad = np.unwrap(np.arctan2(velocity_mps[moving, 1], velocity_mps[moving, 0]))
    return float(np.abs(np.diff(course_rad)).sum())


METRICS = {Metric(column="turned_rad", title="Course turned", unit="rad", digits=1, better=-1): turned_rad}

if __name__ == "__main__":
    import matplotlib.pyplot as plt

    os.environ["UAVEXP_TRUST"] = "own_metric_and_figure"  # this file; a configuration may name its parts
    common = {"metrics": "own_metric_and_figure", "world": "random_columns", "vehicle": "point_mass"}
    arms = ("mcr", "ssp", "tbr")
    flown = [uavexp.fly(strategy=arm, seed=100, **common, **{"world.size_m": [9, 6, 3]}) for arm in arms]
    turned = [trial.metrics["turned_rad"] for trial in flown]
    print(dict(zip(arms, turned, strict=True)))
    figure, axes = plt.subplots(figsize=(4, 3), layout="constrained")
    axes.bar(arms, turned)
    axes.set(ylabel="course turned [rad]", title="one flight each: no result")
    figure.savefig("own_metric_and_figure.png", dpi=120)

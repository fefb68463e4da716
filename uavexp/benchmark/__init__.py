"""A fixed suite that anybody's policy flies: `python -m uavexp benchmark` (`experiments/benchmark`)."""

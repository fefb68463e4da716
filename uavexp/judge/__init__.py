"""Somebody else's flight, judged by the same metrics: `python -m uavexp.judge FILE`."""

"""Metrics: pure functions of a trial's log and the world it was flown in."""

"""Choosing parameters by flying: `python -m uavexp tune` (Optuna)."""

"""Recorded depth images through map and triggers: `python -m uavexp.replay FOLDER`."""

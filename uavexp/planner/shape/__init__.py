"""Shapers: a found path in, a trajectory out."""

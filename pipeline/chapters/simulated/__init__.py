"""Chapters on the simulation, and on the comparison with it."""

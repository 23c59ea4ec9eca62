"""Scenarios and their results: what to simulate, in a user's words, and the simulation as tables."""

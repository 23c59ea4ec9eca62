"""Runs in motion: their signals, phases, and what can be derived from them."""

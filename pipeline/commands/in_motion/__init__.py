"""Runs in motion of a store: alone, and with steady points of the same campaign."""

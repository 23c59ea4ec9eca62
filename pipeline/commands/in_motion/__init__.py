"""Runs in motion of a store: by themselves, and beside the steady points of the same campaign."""

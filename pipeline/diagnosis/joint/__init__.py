"""Steady points and runs in motion of one campaign as evidence for one diagnosis."""

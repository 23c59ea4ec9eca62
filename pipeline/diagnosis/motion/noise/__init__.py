"""Noise of runs in motion: what filters leave of instruments, wander through a campaign, ripple of a turn."""

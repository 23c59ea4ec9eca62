"""Runs in motion as evidence: the force balance of each rotor, what it lacks, and the proof."""

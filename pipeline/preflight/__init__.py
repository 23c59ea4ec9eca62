"""Preflight: what a set of recordings permits, before anything is run."""

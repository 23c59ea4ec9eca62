"""Candidates in motion: every mechanism that runs may show, on each place where it may act."""

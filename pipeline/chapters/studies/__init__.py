"""Chapters of the studies next to a campaign."""

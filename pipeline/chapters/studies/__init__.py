"""Chapters of the studies beside a campaign."""

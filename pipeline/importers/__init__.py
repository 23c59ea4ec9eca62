"""Recordings of other formats brought into layout pmg.v1, and derived signals written for general viewers."""

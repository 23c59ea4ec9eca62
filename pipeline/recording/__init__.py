"""Recordings of layout pmg.v1: the container, its messages, and what they mean."""

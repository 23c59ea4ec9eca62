"""Recordings of a machine, read, filtered and put one after the other."""

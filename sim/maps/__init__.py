"""Torque maps of the magnetic gear: analytic, and from tables of field computations."""

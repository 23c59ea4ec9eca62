"""Machines of other kinds: their files, and the balance of their forces or torques."""

"""Chapters on what was measured: data, conditions, losses, efficiency, power flow, orders."""

"""The bench at rest and at steady speed: gearbox, solution, power chain."""

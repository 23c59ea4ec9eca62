"""Comparison of an analysed grid with the simulation: residuals, tolerances, power flow, documents."""

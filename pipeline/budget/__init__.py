"""What the mean torque of a point is uncertain by, contribution by contribution."""

"""The bench in motion: the whole drivetrain, its transients, its steady states and its linearised behaviour."""

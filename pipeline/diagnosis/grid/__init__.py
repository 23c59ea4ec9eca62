"""The adapter of a campaign: the means of a grid, and the mechanisms of the gearbox, as evidence and candidates."""

"""The page of a campaign of runs in motion."""

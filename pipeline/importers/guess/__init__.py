"""A channel map proposed from what a foreign file shows."""

"""What the points of a test can tell apart, and which further test would."""

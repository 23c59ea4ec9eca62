"""The page that compares two campaigns."""

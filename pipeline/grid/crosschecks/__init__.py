"""Cross-checks: what one recording says held against what else is known: set-points, the campaign, other channels."""

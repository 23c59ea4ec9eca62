"""Short forms of what no mechanism explains: shape, not physics."""

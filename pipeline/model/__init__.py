"""Models with the physics in: kept as TOML, read, applied to a campaign."""

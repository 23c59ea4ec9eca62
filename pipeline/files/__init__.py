"""Files: atomic writes, JSON values, the reading of TOML, work spread over processes."""

"""Settings: the campaign file, and where each setting in force comes from."""

"""What a user chooses: the campaign file, its units, and where each setting in force comes from."""

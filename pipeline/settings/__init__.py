"""What a user chooses: the campaign file, and where each setting in force comes from."""

"""What a machine file adds: the case of its records, its losses, its numbers beside those that are found."""

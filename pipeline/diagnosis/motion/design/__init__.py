"""What further runs in motion would tell: runs with their references, what they would show, and with what power."""

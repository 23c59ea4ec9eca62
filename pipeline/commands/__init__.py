"""The stages behind the commands: each takes a noun, gives a noun, and writes what it made."""

"""Trials of the diagnosis: concealed campaigns from a bench of their own, and what they hold."""

"""Proof of the diagnosis on a bench of its own: concealed campaigns, and what they hold."""

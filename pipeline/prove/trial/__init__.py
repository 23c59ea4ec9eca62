"""The trial of the diagnosis: sealed campaigns drawn, diagnosed unseen, opened, scored."""

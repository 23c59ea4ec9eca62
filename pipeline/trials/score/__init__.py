"""The score of a trial: sealed campaigns drawn, diagnosed unseen, opened, compared with their truth."""

"""From residuals to an explanation: where a mismatch sits, and what may be said about it."""

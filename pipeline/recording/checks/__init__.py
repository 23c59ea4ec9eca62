"""Checks of samples: what a clock, a counter, a transducer or a wire cannot have meant."""

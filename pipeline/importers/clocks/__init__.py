"""Times of a recording as they are: wraps, jitter, lost samples, pauses, and clocks that run apart."""

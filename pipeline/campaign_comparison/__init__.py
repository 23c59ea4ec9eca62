"""Two campaigns matched point by point, subtracted, judged."""

"""Two campaigns beside each other: matched point by point, subtracted, judged."""

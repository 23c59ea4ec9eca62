"""Still drawings: their strokes, and the files they become."""

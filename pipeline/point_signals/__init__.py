"""The signals behind a point of a grid: traces, spectra and uncertainty budget, small enough for a page."""

"""What lies behind a cell of a grid: its window's signals, spectra and uncertainty budget, small enough for a page."""

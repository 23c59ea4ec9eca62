"""Every published figure of the thesis, computed anew from its rounded grids and set beside what is printed."""

"""Every published figure of the thesis, computed anew from its rounded grids and compared with the print."""

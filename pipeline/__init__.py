"""Data: brings recordings to grids, asks the simulator, explains the difference."""

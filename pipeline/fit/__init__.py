"""Fits of a measured grid: loss curves, calibration, noise floor, whitening, losses with their uncertainty."""

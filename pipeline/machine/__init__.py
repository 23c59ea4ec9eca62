"""A machine as data: what its file says about shafts, gear, instruments and records."""

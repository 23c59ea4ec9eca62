"""The catalogue of runs: what a store holds, as a table that can be asked."""

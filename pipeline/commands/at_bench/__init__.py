"""Commands at the bench: the example, the next test as a sheet, recordings watched as they land."""

"""The chapters of the report: each made by a small function from the object it describes."""

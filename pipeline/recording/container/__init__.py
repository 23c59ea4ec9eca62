"""The MCAP container: records walked one by one, checked, and salvaged past damage."""

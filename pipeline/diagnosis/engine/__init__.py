"""The engine: whitened evidence and candidates in; mismatch, places, names, adequacy and withheld proof out.

It knows rows, columns and candidates, and neither gears nor axes. What the rows are is the matter of an adapter:
`pmg.pipeline.diagnosis.grid` for the means of a campaign, `pmg.pipeline.diagnosis.balance` for the force balance of a
machine in motion. Records of the bench itself in motion (coast-downs, load steps) have their place beside these two.
"""

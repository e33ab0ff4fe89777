"""Robot check: checks whether a description is sound and a body able to get up."""

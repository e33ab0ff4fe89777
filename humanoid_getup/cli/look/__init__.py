"""Commands that show results: `replay` and `bench`."""

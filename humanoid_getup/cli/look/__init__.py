"""Commands that look at what was done: `replay` and `bench`."""

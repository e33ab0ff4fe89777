"""Commands that list, make, show and export motions."""

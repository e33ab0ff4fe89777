"""Policies that were trained elsewhere: their descriptions, and networks that we can run."""

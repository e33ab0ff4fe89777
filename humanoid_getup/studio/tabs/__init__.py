"""Tabs of the page, a file each."""

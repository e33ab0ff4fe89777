"""Tabs of the page; each adds its elements where its caller is adding elements."""

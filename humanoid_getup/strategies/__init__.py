"""Ways to get up: planned, learned, stored; and how one is chosen."""

"""`getup first-steps`: the way from a port to the first rise, one command after the other."""

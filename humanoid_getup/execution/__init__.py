"""Sessions on a robot: attempts, recovery between them, the stand and its end."""

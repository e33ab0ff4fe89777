"""On a robot: a session of attempts, recovery between them, the stand and its end."""

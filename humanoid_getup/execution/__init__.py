"""Getting up on a robot: estimation, preflight, supervision, attempts."""

"""Style curves in training: what robots follow, what moves them, what it earns."""

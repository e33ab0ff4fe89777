"""Style curves in training: curves, actions by a pose prior, rewards."""

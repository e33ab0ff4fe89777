"""Import of model files: an MJCF or URDF becomes a robot folder; guesses are marked in it."""

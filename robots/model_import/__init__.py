"""Robots from model files: an MJCF or URDF becomes a robot folder, with what was guessed marked."""

"""Commands that move a robot: to get up, to stand, to lie down, to fall."""

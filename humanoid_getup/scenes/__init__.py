"""Scenes in which robots rise: ground, obstacles, surfaces."""

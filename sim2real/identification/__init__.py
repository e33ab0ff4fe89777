"""Identification: the physics of servos and robots from their logs."""

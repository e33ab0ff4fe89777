"""Disturbances: differences of robots and worlds from the planned ones."""

"""Descriptions of robots: robot.toml, servos and calibration, read and checked."""

"""Service of a robot on its bus: scan, health check, calibration."""
